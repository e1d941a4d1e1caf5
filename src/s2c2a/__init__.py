"""S2C2A."""

__version__ = "0.3.0"
