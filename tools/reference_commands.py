"""Page of all commands, from the parsers of the command line."""

import argparse
import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tyro.extras import SubcommandApp, get_parser

from s2c2a.cli.main import app

from tools.markdown import cell, first_paragraph, header, linked, table

FOLDER = "reference"
SHARED_FROM = 3  # commands; an option of so many is stated once
COLUMNS = ("option", "values", "default", "meaning")
GROUPS = {
    "Data": ("collect", "import", "export"),
    "Training": ("train", "pretrain", "identify"),
    "Control": ("demo", "reach", "session", "run", "live", "ros", "view"),
    "Arms": ("arm", "robot"),
    "Real arms": ("motors", "tracking", "emulate"),
    "Results and installation": (
        "reproduce",
        "benchmark",
        "bench",
        "doctor",
    ),
}
"""Order of the commands."""
OPENING = """# Commands

`s2c2a COMMAND --help` prints the same text. Words in capitals stand for a value of
yours. A value without dashes stands directly behind the command. A flag has no value;
`--no-NAME` switches the flag `--NAME` off. Several values follow one option, separated
by spaces; a repeatable option occurs once for each value.

Every command also takes `--trust file.py:Name` or `--trust module:Name`, repeatable:
custom code that a recording or a weight file names, and that it may run
([extending](../guides/extending.md)).
"""
SUFFIX = re.compile(r"\s*\((default: (?P<default>.*)|required|repeatable)\)$", re.S)
WORDS = {
    "FLOAT": "number",
    "INT": "whole number",
    "PATH": "path",
    "STR": "text",
    "None": "",
}
"""Kinds of values, in words."""
SEVERAL = re.compile(r"\[*(\w+) \[\1 \.\.\.\]+")
"""Placeholder of several values, as the parser writes it."""


@dataclass(frozen=True)
class Command:
    """A command that can be run.

    Attributes:
        name: all words behind `s2c2a`.
        parser: its arguments.
    """

    name: str
    parser: argparse.ArgumentParser

    @property
    def anchor(self) -> str:
        """Anchor of its section."""
        return self.name.replace(" ", "-")

    @property
    def options(self) -> list[argparse.Action]:
        """Its arguments, without --help."""
        return [action for action in self.parser._actions if action.dest != "help"]


def commands_page() -> str:
    """The page: contents by group, then a section for each command."""
    listed = [name for names in GROUPS.values() for name in names]
    commands = _subcommands(app)
    if sorted(listed) != sorted(commands):
        raise SystemExit(f"GROUPS has {sorted(listed)}, s2c2a has {sorted(commands)}")
    leaves = {name: list(_commands_of(name, commands[name].target)) for name in listed}
    counts = Counter(
        _row(action)
        for name in listed
        for leaf in leaves[name]
        for action in leaf.options
    )
    # the most frequent row of an option, so that its name means one thing
    shared = {
        row[0]: row
        for row, count in reversed(counts.most_common())
        if count >= SHARED_FROM
    }
    shared = sorted(shared.values())
    rows = []
    sections = ["## Shared options { #shared }\n", table(COLUMNS, shared)]
    for group, names in GROUPS.items():
        sections.append(f"## {group}\n")
        for number, name in enumerate(names):
            shown = "" if number else group
            rows.append(_contents_row(shown, name, commands[name].help, leaves[name]))
            sections += [_section(leaf, shared) for leaf in leaves[name]]
    contents = table(("group", "command", "purpose"), rows)
    return "\n".join((header("the command line"), OPENING, contents, *sections))


def _contents_row(
    group: str, name: str, purpose: str | None, leaves: list[Command]
) -> tuple[str, str, str]:
    """Row of a command, or of a group of commands with links to all of them."""
    if purpose is None:
        text = first_paragraph(leaves[0].parser.description)
        return group, f"[`{name}`](#{leaves[0].anchor})", linked(text, FOLDER)
    links = [
        f"[{leaf.name.removeprefix(name).strip()}](#{leaf.anchor})" for leaf in leaves
    ]
    return group, f"`{name}`", f"{purpose.rstrip('.')}: {', '.join(links)}"


def _subcommands(group: SubcommandApp) -> dict:
    # tyro has no public list of them
    return group._subcommands


def _commands_of(name: str, target: Callable | SubcommandApp) -> Iterator[Command]:
    if not isinstance(target, SubcommandApp):
        yield Command(name, _parser_of(target))
        return
    for child, entry in _subcommands(target).items():
        yield from _commands_of(f"{name} {child.replace('_', '-')}", entry.target)


def _parser_of(function: Callable) -> argparse.ArgumentParser:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return get_parser(function)


def _section(command: Command, shared: list[tuple[str, ...]]) -> str:
    """Usage and options of a command; those of `shared` are named alone."""
    parts = [f"### {command.name} {{ #{command.anchor} }}\n"]
    parts.append(linked(command.parser.description or "", FOLDER) + "\n")
    parts.append(f"```text\n{_usage(command.name, command.options)}\n```\n")
    rows = [_row(action) for action in command.options]
    own = [row for row in rows if row not in shared]
    if own:
        parts.append(table(COLUMNS, own))
    names = ", ".join(row[0] for row in rows if row in shared)
    if names:
        parts.append(f"[Shared](#shared): {names}\n")
    return "\n".join(parts)


def _usage(name: str, actions: list[argparse.Action]) -> str:
    words = ["s2c2a", name]
    for action in actions:
        if not action.option_strings:
            metavar = _metavar(action)
            words.append(metavar if _is_required(action) else f"[{metavar}]")
        elif action.required:
            words.append(f"{action.option_strings[0]} {_metavar(action)}")
    if any(action.option_strings and not action.required for action in actions):
        words.append("[OPTIONS]")
    return " ".join(words)


def _row(action: argparse.Action) -> tuple[str, str, str, str]:
    suffix = SUFFIX.search(action.help or "")
    meaning = SUFFIX.sub("", action.help or "")
    return (
        ", ".join(f"`{name}`" for name in _names(action)).replace("|", r"\|"),
        _values(action),
        _default(action, suffix),
        linked(cell(meaning), FOLDER),
    )


def _names(action: argparse.Action) -> list[str]:
    """Names to show; a flag that is on shows how to switch it off."""
    if not action.option_strings:
        return [_metavar(action)]
    if action.nargs == 0 and action.default is True:
        return list(action.option_strings)
    return list(action.option_strings[:1])


def _metavar(action: argparse.Action) -> str:
    """Placeholder of the value; `NAME ...` for several."""
    return SEVERAL.sub(r"\1 ...", str(action.metavar))


def _is_required(action: argparse.Action) -> bool:
    return action.required and "(required)" in (action.help or "")


def _values(action: argparse.Action) -> str:
    if action.nargs == 0:
        return "flag"
    metavar = _metavar(action)
    words = re.sub("[{}]", "", metavar.removesuffix("...").strip())
    kinds = [_kind(word) for word in words.split("|")]
    text = ", ".join(kind for kind in kinds if kind)
    if metavar.endswith("..."):
        return f"{text}; several"
    if "(repeatable)" in (action.help or ""):
        return f"{text}; repeatable"
    return text


def _kind(word: str) -> str:
    if word in WORDS:
        return WORDS[word]
    choices = [choice for choice in word.split(",") if choice != "None"]
    return ", ".join(f"`{choice}`" for choice in choices)


def _default(action: argparse.Action, suffix: re.Match | None) -> str:
    if _is_required(action):
        return "required"
    text = suffix["default"] if suffix else None
    if text in (None, "None", "", "''"):
        return ""
    if action.nargs == 0:
        return "on" if text == "True" else "off"
    return f"`{text}`"
