"""Command line of S2C2A: one module for each command."""
