"""Commands `s2c2a live` and `s2c2a view`."""
