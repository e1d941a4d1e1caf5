"""Command `s2c2a`: its subcommands and error messages."""

import sys
from collections.abc import Sequence
from typing import Literal

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from s2c2a import __version__
from s2c2a.cache import enable_compilation_cache
from s2c2a.cli import (
    arm,
    bench,
    collect,
    doctor,
    emulate,
    identify,
    import_,
    live,
    motors,
    pretrain,
    reproduce,
    run,
    sweep,
    tracking,
    train,
    view,
)
from s2c2a.cli.interrupts import INTERRUPTED, interrupts_as_exceptions
from s2c2a.errors import S2C2AError

FAULT = 2  # exit code
RESUME_HINTS = {
    "collect": "; finished episodes are kept, and `collect` goes on with --resume",
    "pretrain": "; finished recordings are kept: repeat the command to continue",
    "run": "; finished runs are kept: continue with --out and the run directory",
    "sweep": "; finished trials are kept: repeat the command to continue",
    "reproduce": "; finished work is kept: repeat the command to continue",
}
"""How to continue an interrupted command, by command."""

app = SubcommandApp()
app.command(reproduce.demo)
for command in (
    live.live,
    view.view,
    collect.collect,
    identify.identify,
    pretrain.pretrain,
    train.train,
    run.run,
    sweep.sweep,
):
    app.command(command)
app.command(name="import")(import_.import_)
app.command(bench.bench)
app.command(doctor.doctor)
app.command(
    arm.app, name="arm", help="Check, describe, draw, copy or randomize an arm file."
)
app.command(arm.robot_app, name="robot", help="Check a robot.")
app.command(motors.app, name="motors", help="Bring up the servos of a real arm.")
app.command(
    tracking.app,
    name="tracking",
    help="Calibrate a pose tracker; print tags for a webcam.",
)
app.command(
    emulate.app,
    name="emulate",
    help="Emulate the devices of a real arm.",
)
app.command(
    reproduce.app,
    name="reproduce",
    help="Reproduce the project's tables from scratch.",
)


@app.command
def completion(shell: Positional[Literal["bash", "zsh", "fish"]]) -> None:
    """Print a script that completes commands and options in a shell.

    Load it in the present shell with `source <(s2c2a completion bash)`, or
    `s2c2a completion fish | source`.

    Args:
        shell: the shell that reads the script.
    """
    # a file named "-" is the standard output
    _run_command(("--tyro-write-completion", shell, "-"))


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the command `s2c2a`."""
    if arguments is None:
        arguments = sys.argv[1:]
    if list(arguments) == ["--version"]:
        print(f"s2c2a {__version__}")
        return
    enable_compilation_cache()
    try:
        with interrupts_as_exceptions():
            _run_command(arguments)
    except S2C2AError as error:
        _exit_with(str(error))
    except OSError as error:
        has_path = bool(error.filename)
        advice = "; check the path and its permissions" if has_path else ""
        _exit_with(f"{error}{advice}")
    except KeyboardInterrupt:
        verb = next(iter(arguments), "")
        print(f"\ns2c2a: interrupted{RESUME_HINTS.get(verb, '')}", file=sys.stderr)
        sys.exit(INTERRUPTED)


def _run_command(arguments: Sequence[str]) -> None:
    app.cli(
        prog="s2c2a",
        description="Plan and control modular soft robot arms. "
        "`s2c2a --version` prints the version.",
        args=arguments,
    )


def _exit_with(message: str) -> None:
    print(f"s2c2a: {message}", file=sys.stderr)
    sys.exit(FAULT)
