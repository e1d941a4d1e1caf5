"""Command `s2c2a`: its subcommands and error messages."""

import inspect
import io
import math
import os
import re
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress

from tyro.extras import SubcommandApp

import s2c2a
from s2c2a.cli import (
    arm,
    collect,
    demo,
    doctor,
    export,
    pretrain,
    reach,
    run,
    session,
    train,
)
from s2c2a.cli.interrupts import INTERRUPTED, interrupts_as_exceptions
from s2c2a.errors import S2C2AError, did_you_mean, nearest_name
from s2c2a.files.text import LARGEST, MAX_SEED, manifests_of_one_command
from s2c2a.plugins.discovery import installed, trust_code, trust_of_one_command

FAULT = 2  # exit code, as of argparse
OPTION = "--[a-z][a-z0-9.-]*"
NUMBER = rf"({OPTION}) (INT|FLOAT)\b"
"""An option of a help text that takes a number, and the kind of number."""
RANGES = {"INT": (int, 0, MAX_SEED), "FLOAT": (float, -LARGEST, LARGEST)}
CHOICES = rf"({OPTION}) {{([^}}\n]*)}}\s"
"""An option of a help text that has a closed list of values, and these."""
TRUST = "--trust"
RESUME_HINTS = {
    "collect": "; finished episodes are kept, and `collect` goes on with --resume",
    "pretrain": "; finished recordings are kept: repeat the command to continue",
    "tracking": "; `tracking frames` keeps held bends: repeat it to continue",
    "run": "; finished runs are kept: continue with --out and the run directory",
}
"""How to continue an interrupted command, by command."""


VERBS: dict[str, Callable[..., None]] = {
    "demo": demo.demo,
    "collect": collect.collect,
    "export": export.export,
    "pretrain": pretrain.pretrain,
    "train": train.train,
    "session": session.session,
    "reach": reach.reach,
    "run": run.run,
    "doctor": doctor.doctor,
}
GROUPS = {
    "arm": (arm.app, "Check, draw, copy or randomize an arm file."),
    "robot": (arm.robot_app, "Check a robot."),
}
"""Groups of commands, each with its help."""


def _add_installed_commands() -> None:
    """Add the commands of the wings and of other packages.

    An entry point of `s2c2a.commands` is a function, or a pair of a `SubcommandApp` and
    its help. One that cannot be imported, or has the name of a command above, is left
    out, and named: the others work.
    """
    for name, point in installed("command").items():
        if name in VERBS or name in GROUPS:
            print(
                f"s2c2a: the command '{name}' of {point.module} is left out: the name "
                "is taken",
                file=sys.stderr,
            )
            continue
        try:
            command = point.load()
        except Exception as error:  # it may be a stranger's
            print(
                f"s2c2a: the command '{name}' cannot be loaded: "
                f"{type(error).__name__}: {error}",
                file=sys.stderr,
            )
            continue
        if isinstance(command, tuple):
            GROUPS[name] = command
        else:
            VERBS[name] = command


_add_installed_commands()
COMMANDS = (*VERBS, *GROUPS)

app = SubcommandApp()
overview = SubcommandApp()
"""The list of commands, with a sentence for each; the help of a command has the rest."""
for name, verb in VERBS.items():
    app.command(name=name)(verb)
    sentence = (inspect.getdoc(verb) or "").partition("\n\n")[0]
    overview.command(name=name, help=sentence)(verb)
for name, (group, help_text) in GROUPS.items():
    app.command(group, name=name, help=help_text)
    overview.command(group, name=name, help=help_text)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the command `s2c2a`."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given == ["--version"]:
        print(f"s2c2a {s2c2a.__version__}")
        return
    before = warnings.formatwarning
    # readers do not need the line of code
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    with trust_of_one_command(), manifests_of_one_command():
        try:
            given = _without_trusted_code(given)
            _check_command(given)
            _check_options(given)
            # the help of tyro never ends on narrower terminals
            with interrupts_as_exceptions(), _at_least(40):
                _run_command(given)
        except S2C2AError as error:
            _exit_with(str(error))
        except BrokenPipeError:
            # the reader of the output has closed it, as `head` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except OSError as error:
            has_path = bool(error.filename)
            advice = "; check the path and its permissions" if has_path else ""
            _exit_with(f"{error}{advice}")
        except KeyboardInterrupt:
            verb = next(iter(given), "")
            print(f"\ns2c2a: interrupted{RESUME_HINTS.get(verb, '')}", file=sys.stderr)
            sys.exit(INTERRUPTED)
        finally:
            warnings.formatwarning = before


def _run_command(arguments: Sequence[str]) -> None:
    is_list = not arguments or arguments[0] in ("-h", "--help")
    (overview if is_list else app).cli(
        prog="s2c2a",
        description="Plan and control modular soft robot arms. "
        "`s2c2a --version` prints the version. Every command also takes --trust "
        "file.py:Name: custom code that a recording or a weight file may run.",
        args=arguments,
    )


def _without_trusted_code(given: Sequence[str]) -> list[str]:
    """Trust the names of `--trust NAME`, an option of every command; return the rest.

    Raises:
        S2C2AError: a name is missing.
    """
    rest = []
    words = iter(given)
    for word in words:
        option, equals, name = word.partition("=")
        if option != TRUST:
            rest.append(word)
            continue
        name = name if equals else next(words, "")
        if ":" not in name:
            raise S2C2AError(
                f"{TRUST} '{name}' names no code; give module:Name or file.py:Name"
            )
        trust_code(name)
    return rest


def _check_command(given: Sequence[str]) -> None:
    """Suggest the command that a misspelled one may mean.

    Raises:
        S2C2AError: there is no such command.
    """
    words, known = ["s2c2a"], list(COMMANDS)
    if given and given[0] in GROUPS:
        words.append(given[0])
        # tyro has no public list of them
        known = [name.replace("_", "-") for name in GROUPS[given[0]][0]._subcommands]
    word = next(iter(given[len(words) - 1 :]), "-")
    if word.startswith("-") or word.replace("_", "-") in known:
        return
    nearest = nearest_name(word, known)
    advice = f"did you mean {nearest}?" if nearest else f"see {' '.join(words)} --help"
    raise S2C2AError(f"no command '{' '.join([*words[1:], word])}'; {advice}")


def _check_options(given: Sequence[str]) -> None:
    """Check options, choices and numbers of this command by its help.

    Raises:
        S2C2AError: the command has no such option, the option no such choice, or a
            number is out of range.
    """
    command = given[: 2 if given and given[0] in GROUPS else 1]
    words = given[len(command) :]
    if not words or "--help" in words or "-h" in words or given[0].startswith("-"):
        return
    help_text = help_of(command)
    known = set(re.findall(OPTION, help_text))
    advice = f"see s2c2a {' '.join(command)} --help"
    for name in (word.partition("=")[0] for word in words if word.startswith("--")):
        if known and name.replace("_", "-") not in known:
            likely = did_you_mean(name, known)
            raise S2C2AError(
                f"{' '.join(command)} has no option {name}{likely}; {advice}"
            )
    for name, listed in re.findall(CHOICES, help_text):
        choices = listed.split(",")
        value = _value_of(name, words)
        if value is not None and value not in choices:
            raise S2C2AError(
                f"{name} '{value}' is none of {', '.join(filter(None, choices))}"
                f"{did_you_mean(value, choices)}; {advice}"
            )
    for name, kind in re.findall(NUMBER, help_text):
        convert, low, high = RANGES[kind]
        value = _value_of(name, words)
        try:
            number = convert(value or "")
        except ValueError:  # none is given, or tyro names the fault
            continue
        # a limit of time may be infinite
        if not (low <= number <= high or number == math.inf):
            raise S2C2AError(
                f"{name} {value} is out of range; give a number from {low:.0f} to {high:.0f}"
            )


def help_of(command: Sequence[str]) -> str:
    """Return the help of a command; empty for no such command."""
    output = io.StringIO()
    # no line is longer
    with redirect_stdout(output), suppress(SystemExit), _at_least(1000):
        _run_command([*command, "--help"])
    return output.getvalue()


@contextmanager
def _at_least(columns: int) -> Iterator[None]:
    """Write at least that wide [characters], however narrow the terminal is."""
    given = {"COLUMNS": os.environ["COLUMNS"]} if "COLUMNS" in os.environ else {}
    if shutil.get_terminal_size().columns < columns:
        os.environ["COLUMNS"] = str(columns)
    try:
        yield
    finally:
        os.environ.pop("COLUMNS", None)
        os.environ.update(given)


def _value_of(option: str, words: Sequence[str]) -> str | None:
    """The value of an option; None if it is not given, or has no value."""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        name, equals, value = word.partition("=")
        if name.replace("_", "-") == option:
            value = value if equals else following
            return None if value.startswith("--") else value
    return None


def _exit_with(message: str) -> None:
    print(f"s2c2a: {message}", file=sys.stderr)
    sys.exit(FAULT)
