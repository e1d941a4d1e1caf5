"""Markdown that tools write: tables, and links to pages that texts name."""

import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tools import ROOT

COMMAND = "python -m tools.make_reference"
PAGE_NAME = re.compile(r"docs/([a-z/-]+\.md)")


def header(source: str) -> str:
    """Comment at the beginning of a generated page."""
    return f"<!-- Made by `{COMMAND}` from {source}; do not edit. -->\n"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Table of Markdown cells."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def cell(text: str) -> str:
    """Text as one line that a table can hold."""
    return " ".join(text.split()).replace("|", r"\|")


def linked(text: str, folder: str) -> str:
    """Text in which names of pages are links, as seen from a folder of docs/."""
    titles = page_titles()
    up = "../" * len(Path(folder).parts)

    def link(match: re.Match) -> str:
        page = match[1]
        return f"[{titles.get(page, page)}]({up}{page})"

    return PAGE_NAME.sub(link, text)


def page_titles() -> dict[str, str]:
    """Title of every page in the navigation."""
    settings = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))
    return dict(_pages(settings["project"]["nav"]))


def _pages(entries: list[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    for entry in entries:
        for title, target in entry.items():
            if isinstance(target, list):
                yield from _pages(target)
            else:
                yield target, title


def first_paragraph(text: str | None) -> str:
    """First paragraph of a docstring, on one line."""
    return " ".join((text or "").strip().split("\n\n")[0].split())
