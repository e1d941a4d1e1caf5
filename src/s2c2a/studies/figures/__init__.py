"""Figures like those of the paper: paths and poses (`space`), plots over time (`time`)."""
