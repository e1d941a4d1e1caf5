"""S2C2A."""

__version__ = "0.1.0"
