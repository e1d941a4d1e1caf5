"""Check of the documented command lines: options exist, values parse.

Nothing is executed: tyro parses the arguments for functions that do nothing but refuse
options without effect.
"""

import functools
import io
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path

import tyro
from sybil import Document
from tyro.extras import SubcommandApp

from s2c2a.cli.dependent_options import check_conditions
from s2c2a.cli.main import TRUST, app
from s2c2a.errors import S2C2AError
from s2c2a_experiments.cli import TABLES

from tools.page_blocks import FENCES, HIDDEN_COMMANDS, SHELLS, language_of

COMMAND = "s2c2a"
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
PLACEHOLDER = re.compile(r"^[A-Z][A-Z_]*$")
NAME = re.compile(r"[a-z]")
OPTION = re.compile(r"--[\w-]+")
ALONE = re.compile(r"^[ #]*(s2c2a [a-z](?:\\\n|.)*)", re.MULTILINE)
CONTINUED = re.compile(r"\\+\n[ #]*")
SEPARATOR = re.compile(r"^[();<>|&]+$")
INCOMPLETE = ("Required options", "Missing argument")
"""What tyro prints above arguments that are absent."""


@dataclass(frozen=True)
class CommandLine:
    """Arguments of the command on a page."""

    place: str
    words: tuple[str, ...]
    """Without the command itself."""
    inline: bool = False
    """In the text: required arguments may be absent, and N stands for a number."""


def command_lines(page: Path) -> list[CommandLine]:
    """All command lines of a page, in blocks and in the text."""
    document = Document(page.read_text(encoding="utf-8"), str(page))
    fenced = [*FENCES(document)]
    shown = [block for block in fenced if language_of(block) in SHELLS]
    lines = []
    for block in [*shown, *HIDDEN_COMMANDS(document)]:
        first = document.text.count("\n", 0, block.start) + 2
        lines += _lines_of_block(page, first, block.lexemes["source"])
    text = document.text
    for block in fenced:
        blank = re.sub(r"[^\n]", " ", text[block.start : block.end])
        text = text[: block.start] + blank + text[block.end :]
    return [*lines, *_inline_lines(page, text)]


def command_lines_in_code(file: Path) -> list[CommandLine]:
    """All command lines in a Python or TOML file: quoted, or alone on a line of text."""
    text = file.read_text(encoding="utf-8")
    lines = []
    for found in ALONE.finditer(text):
        first = text.count("\n", 0, found.start()) + 1
        lines += _lines_of_block(file, first, CONTINUED.sub(" ", found[1]))
    return [*lines, *_inline_lines(file, text)]


def fault_of(line: CommandLine) -> str:
    """What is wrong with a command line; empty if it parses."""
    given = list(line.words)
    if TRUST in given:  # which `main` takes out of every command
        place = given.index(TRUST)
        given[place : place + 2] = []
    target, words = _target(app, given)
    if isinstance(target, SubcommandApp):
        names = ", ".join(target._subcommands)
        if line.inline and words and PLACEHOLDER.match(words[0]):
            return ""  # any command
        if words and not words[0].startswith("-"):
            return f"'{words[0]}' is no command; commands are {names}"
        return "" if line.inline else f"a command is missing: {names}"
    table = words[0] if line.words[0] == "reproduce" and words else ""
    if NAME.match(table) and table not in TABLES:
        return f"'{table}' is no table; tables are {', '.join(TABLES)}"
    output = _parse(target, words)
    if output and line.inline:
        replaced = ["1" if PLACEHOLDER.match(word) else word for word in words]
        output = _parse(target, replaced)
    if line.inline and any(title in output for title in INCOMPLETE):
        return _unknown_option(target, words)
    return output


def _lines_of_block(page: Path, first: int, commands: str) -> Iterator[CommandLine]:
    start, text = first, ""
    for number, row in enumerate(commands.splitlines(), first):
        start = start if text else number
        text += row
        if row.endswith("\\"):
            text = text[:-1]
            continue
        try:
            simple = _simple_commands(text)
        except ValueError:  # a quotation goes on in the next row
            text += "\n"
            continue
        text = ""
        for words in simple:
            if words[:1] == [COMMAND]:
                yield CommandLine(f"{page}:{start}", tuple(words[1:]))


def _simple_commands(text: str) -> list[list[str]]:
    """Words of each command of a line of shell code."""
    lexer = shlex.shlex(text, posix=True, punctuation_chars=True)
    lexer.commenters = "#"
    lexer.wordchars += "=@:,+%[]{}$!"
    commands: list[list[str]] = [[]]
    for word in lexer:
        if SEPARATOR.match(word):
            commands.append([])
        else:
            commands[-1].append(word)
    return [words for words in commands if words]


def _inline_lines(page: Path, text: str) -> Iterator[CommandLine]:
    for found in INLINE.finditer(text):
        words = _words(found[1])
        place = f"{page}:{text.count(chr(10), 0, found.start()) + 1}"
        if words[:1] == [COMMAND] and len(words) > 1 and not words[1].startswith("-"):
            yield CommandLine(place, tuple(words[1:]), inline=True)
        elif _is_short_form(words):
            yield CommandLine(place, tuple(words), inline=True)


def _is_short_form(words: Sequence[str]) -> bool:
    """Whether words are a command with options, without `s2c2a` in front."""
    has_option = any(word.startswith("--") for word in words)
    return has_option and _named(app, words[0]) is not None


def _words(code: str) -> list[str]:
    """Words of inline code, without brackets of optional parts, dots and pipes."""
    try:
        words = shlex.split(code.partition(" | ")[0])
    except ValueError:  # a quotation mark alone: no command line
        return []
    bare = [word.strip("[]") if "[" in word or "]" in word else word for word in words]
    return [word for word in bare if word not in ("", "...")]


def _target(
    commands: SubcommandApp, words: list[str]
) -> tuple[SubcommandApp | Callable, list[str]]:
    """Function of a command line, and its arguments; a group if no function follows."""
    found = _named(commands, words[0]) if words else None
    if found is None:
        return commands, words
    if isinstance(found, SubcommandApp):
        return _target(found, words[1:])
    return found, words[1:]


def _named(commands: SubcommandApp, name: str) -> SubcommandApp | Callable | None:
    """Command of a name; hyphens and underscores are alike."""
    for known, command in commands._subcommands.items():
        if known.replace("_", "-") == name.replace("_", "-"):
            return command.target
    return None


def _parse(function: Callable, words: list[str]) -> str:
    """Output of the parser if it refuses the arguments; else empty."""
    output = io.StringIO()
    try:
        with redirect_stderr(output), redirect_stdout(output):
            tyro.cli(_without_body(function), args=words, prog=COMMAND)
    except SystemExit as refused:
        return output.getvalue() if refused.code else ""
    except S2C2AError as refused:
        return str(refused)
    return ""


def _help_of(function: Callable) -> str:
    output = io.StringIO()
    with suppress(SystemExit), redirect_stdout(output):
        tyro.cli(_without_body(function), args=["--help"], prog=COMMAND)
    return output.getvalue()


def _unknown_option(function: Callable, words: list[str]) -> str:
    """Fault of incomplete arguments, whose options tyro does not check."""
    known = set(OPTION.findall(_help_of(function)))
    given = [found[0] for word in words if (found := OPTION.match(word))]
    unknown = [option for option in given if option not in known]
    return f"unknown options: {', '.join(unknown)}" if unknown else ""


def _without_body(function: Callable) -> Callable:
    """A function of the same arguments that checks their conditions and does nothing."""

    @functools.wraps(function)
    def nothing(**given: object) -> None:
        check_conditions(function, **given)

    return nothing
