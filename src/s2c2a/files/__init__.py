"""Files: guarded reading, atomic writing, tables, and validation of what they hold."""
