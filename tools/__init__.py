"""Checks and generated parts of the documentation."""

from pathlib import Path

ROOT = Path(__file__).parents[1]


def all_pages() -> list[Path]:
    """Readme and all pages of the documentation."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
