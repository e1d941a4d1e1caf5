"""Blocks of the documentation pages, with the marks that say how to treat them.

A mark is a comment directly above the fence of a block:

- `<!-- not run: REASON -->`: the block is not executed. The reason begins with one of
  `REASONS`.
- `<!-- in background -->`: a program that runs until it is stopped. It runs beside the
  following blocks until the page ends.
- `<!-- file: NAME -->`: the text is written to this file of the page's folder.
- `<!-- append: NAME -->`: the text is appended to this file.

Two comments stand alone:

- `<!-- background ends -->` stops what runs in the background.
- `<!-- run first:`, then lines of shell commands, then `-->`: commands that are not
  shown, such as those that make the files of another page.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

ROOT = Path(__file__).parents[1]
REASONS = (
    "a real arm",
    "a device",
    "longer than ten minutes",
    "another machine",
    "a server that runs until stopped",
    "installs software",
    "trains networks for minutes",
    "quoted code",
    "data that are not shipped",
)
"""Why a block may stay without a run."""

SHELLS = ("sh", "bash", "console")
NOT_RUN = "not run"
BACKGROUND = "in background"
FILE = "file"
APPEND = "append"
RUN_FIRST = "run first"
BACKGROUND_ENDS = "background ends"
FENCE = re.compile(r"^(?P<indent>\s*)(?P<ticks>`{3,}|~{3,})\s*(?P<info>[^`]*)$")
MARK = re.compile(r"^\s*<!--\s*(?P<name>[a-z ]+?)\s*(?::\s*(?P<detail>.*?))?\s*-->\s*$")
HIDDEN = re.compile(rf"^\s*<!--\s*{RUN_FIRST}:\s*$")
SNIPPET = re.compile(r'^(?P<indent>\s*)-+8<-+\s+"(?P<path>[^":]+)(?::(?P<part>\w+))?"$')
WITH_DETAIL = (NOT_RUN, FILE, APPEND)
BLOCK_MARKS = (*WITH_DETAIL, BACKGROUND)


class PageError(Exception):
    """A page has a mark that cannot be obeyed."""


@dataclass(frozen=True)
class Block:
    """A block of a page."""

    page: str
    line: int
    """Of its text; counts from 1."""
    language: str
    text: str
    mark: str = ""
    detail: str = ""
    """Reason or name of a file."""

    @property
    def place(self) -> str:
        """Page and line."""
        return f"{self.page}:{self.line}"


def all_pages(root: Path = ROOT) -> list[str]:
    """Paths of all pages, relative to the root."""
    pages = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    return [page.relative_to(root).as_posix() for page in pages]


def blocks_of(page: str, root: Path = ROOT) -> list[Block]:
    """All blocks of a page, in order.

    Raises:
        PageError: a mark lacks a reason or a name, or a fence is not closed.
    """
    text = (root / page).read_text(encoding="utf-8")
    blocks = list(_blocks(page, text.splitlines(), root))
    for block in blocks:
        _check_mark(block)
    return blocks


def text_outside_blocks(page: str, root: Path = ROOT) -> str:
    """Text of a page whose blocks are replaced by empty lines."""
    lines = (root / page).read_text(encoding="utf-8").splitlines()
    number = 0
    while number < len(lines):
        fence = FENCE.match(lines[number])
        if fence is None:
            number += 1
            continue
        end = _end_of_fence(page, lines, number, fence)
        for inner in range(number, end + 1):
            lines[inner] = ""
        number = end + 1
    return "\n".join(lines)


def digest_of(blocks: list[Block]) -> str:
    """Digest of what the blocks of a page do."""
    parts = [f"{b.language}\0{b.mark}\0{b.detail}\0{b.text}" for b in blocks]
    return sha256("\0\0".join(parts).encode()).hexdigest()


def _blocks(page: str, lines: list[str], root: Path) -> Iterator[Block]:
    number = 0
    while number < len(lines):
        line = lines[number]
        fence = FENCE.match(line)
        if fence is not None:
            end = _end_of_fence(page, lines, number, fence)
            yield _fenced(page, lines, number, end, root)
            number = end
        elif HIDDEN.match(line):
            end = _end_of_comment(page, lines, number)
            text = "\n".join(lines[number + 1 : end]) + "\n"
            yield Block(page, number + 2, "sh", text, RUN_FIRST)
            number = end
        elif _mark_in(line)[0] == BACKGROUND_ENDS:
            yield Block(page, number + 1, "", "", BACKGROUND_ENDS)
        number += 1


def _fenced(page: str, lines: list[str], start: int, end: int, root: Path) -> Block:
    fence = FENCE.match(lines[start])
    assert fence is not None
    indent = len(fence["indent"])
    text = "\n".join(_expanded(line[indent:], root) for line in lines[start + 1 : end])
    language = re.search(r"[\w+-]+", fence["info"])
    mark, detail = _mark_in(lines[start - 1]) if start else ("", "")
    if mark not in BLOCK_MARKS:
        mark = detail = ""
    return Block(
        page, start + 2, language[0] if language else "", text + "\n", mark, detail
    )


def _end_of_fence(page: str, lines: list[str], start: int, fence: re.Match) -> int:
    ticks = fence["ticks"]
    closing = re.compile(rf"^\s*{re.escape(ticks[0])}{{{len(ticks)},}}\s*$")
    for number in range(start + 1, len(lines)):
        if closing.match(lines[number]):
            return number
    raise PageError(f"{page}:{start + 1}: the block does not end")


def _end_of_comment(page: str, lines: list[str], start: int) -> int:
    for number in range(start + 1, len(lines)):
        if lines[number].strip() == "-->":
            return number
    raise PageError(f"{page}:{start + 1}: the comment does not end with a line -->")


def _mark_in(line: str) -> tuple[str, str]:
    """Name and detail of a mark; empty if the line has none."""
    found = MARK.match(line)
    if found is None:
        return "", ""
    return found["name"], found["detail"] or ""


def _check_mark(block: Block) -> None:
    if block.mark in WITH_DETAIL and not block.detail:
        raise PageError(f"{block.place}: the mark '{block.mark}' needs ': ...'")
    if block.mark == NOT_RUN and not block.detail.startswith(REASONS):
        raise PageError(
            f"{block.place}: the reason '{block.detail}' begins with none of "
            + ", ".join(REASONS)
        )
    name = Path(block.detail)
    if block.mark in (FILE, APPEND) and (name.is_absolute() or ".." in name.parts):
        raise PageError(f"{block.place}: {name} lies outside of the page's folder")


def _expanded(line: str, root: Path) -> str:
    """The text of a file where a line includes it; else the line."""
    include = SNIPPET.match(line)
    if include is None:
        return line
    text = (root / include["path"]).read_text(encoding="utf-8").rstrip("\n")
    if include["part"]:
        start = text.index(f"[start:{include['part']}]")
        end = text.index(f"[end:{include['part']}]")
        text = "\n".join(text[start:end].splitlines()[1:-1])
    return "\n".join(include["indent"] + row for row in text.splitlines())
