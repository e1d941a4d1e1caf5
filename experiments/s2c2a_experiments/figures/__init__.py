"""Figures like the paper's: paths and poses (`space`), plots over time (`time`)."""
