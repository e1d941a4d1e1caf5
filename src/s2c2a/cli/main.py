"""`s2c2a`: the verbs, and errors told in one line."""

import sys
from collections.abc import Sequence

from tyro.extras import SubcommandApp

from s2c2a.cache import keep_programs
from s2c2a.cli import (
    arm,
    bench,
    collect,
    doctor,
    identify,
    import_,
    live,
    reproduce,
    run,
    sweep,
    train,
    view,
)
from s2c2a.cli.interrupts import INTERRUPTED, interrupts_heeded
from s2c2a.cli.renamed import check_renamed
from s2c2a.errors import S2C2AError

FAULT = 2  # exit code
GOES_ON = {
    "collect": "; what was whole is kept, and `collect` goes on with --resume",
    "run": "; what was whole is kept, and the same goes on where --out names its folder",
    "sweep": "; what was whole is kept: say the same again to go on",
    "reproduce": "; what was whole is kept: say the same again to go on",
}
"""Verb -> what becomes of what was interrupted."""

app = SubcommandApp()
app.command(reproduce.demo)
for verb in (
    live.live,
    view.view,
    collect.collect,
    identify.identify,
    train.train,
    run.run,
    sweep.sweep,
):
    app.command(verb)
app.command(name="import")(import_.import_)
app.command(bench.bench)
app.command(doctor.doctor)
app.command(
    arm.app, name="arm", help="Explain, check, describe, draw or copy an arm file."
)
app.command(arm.robot_app, name="robot", help="Check a body.")
app.command(
    reproduce.app,
    name="reproduce",
    help="Make the project's tables again, from nothing.",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the command `s2c2a`."""
    keep_programs()
    try:
        with interrupts_heeded():
            check_renamed(sys.argv[1:] if arguments is None else arguments)
            app.cli(
                prog="s2c2a",
                description="Plan and control modular soft robot arms.",
                args=arguments,
            )
    # the latter: a place that cannot be read or written, named in the error
    except (S2C2AError, OSError) as error:
        advice = (
            "; check the path and its permissions"
            if isinstance(error, OSError) and error.filename
            else ""
        )
        print(f"s2c2a: {error}{advice}", file=sys.stderr)
        sys.exit(FAULT)
    except KeyboardInterrupt:
        verb = next(iter(sys.argv[1:] if arguments is None else arguments), "")
        print(f"\ns2c2a: interrupted{GOES_ON.get(verb, '')}", file=sys.stderr)
        sys.exit(INTERRUPTED)
