"""Execution: compiled programs, executors, versions, and progress."""
