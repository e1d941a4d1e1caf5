"""S2C2A."""

__version__ = "0.2.0.dev0"
