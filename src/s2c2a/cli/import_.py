"""`s2c2a import`: logs of an arm, told by a map, become a recording and an arm file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.logs import Imported

ArmFile = Annotated[str | None, tyro.conf.arg(metavar="PRESET|FILE")]


def import_(
    logs: tyro.conf.Positional[tuple[Path, ...]],
    map: Path,
    out: Path,
    arm: ArmFile = None,
    like: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Make a recording of logs of an arm: CSV, NPZ or MAT, told by a map file (docs/real-data.md).

    Writes the recording, and beside it the arm file that was found, with the
    uncertainty of each number; with --like the recording alone.

    Args:
        logs: files of measurements; each is a session, or as many as the map joins are.
        map: says what the columns are (TOML).
        out: the recording to write, such as mine.episodes.
        arm: take this arm, whose cables are matched with those found, in place of the
            one that is found.
        like: a recording that was imported before, of the same arm before the same
            cameras: frame, cables and arm are as in it, and nothing is found anew.
        overwrite: replace the recording and the arm file if they exist.
    """
    from s2c2a.data import load_recording
    from s2c2a.logs import (
        arm_file_of,
        import_again,
        import_logs,
        load_map,
        save_imported,
        summary,
    )

    if out.suffix != ENDING:
        raise S2C2AError(
            f"{out}: recordings end in {ENDING}; say --out {out.with_suffix(ENDING).name}"
        )
    if not logs:
        raise S2C2AError(
            "say which logs to import: s2c2a import LOG... --map FILE --out FILE"
        )
    if arm and like:
        raise S2C2AError(
            "--arm and --like were given; the arm is that of the recording, so leave --arm out"
        )
    there = [path for path in (out, arm_file_of(out)) if path.exists()]
    if there and not overwrite:
        raise S2C2AError(f"{there[0]} exists; choose another name, or say --overwrite")
    if like and (arm_file_of(out).exists() or out.resolve() == like.resolve()):
        raise S2C2AError(
            f"{out} was imported by itself, or is what --like names; choose another name for --out"
        )
    told = load_map(map)
    options = {
        "map": map.name,
        "logs": [path.name for path in logs],
        **told.source.model_dump(),
    }
    if like:
        again = import_again(logs, told, load_recording(like))
        save_imported(again, out, options)
        print("\n".join([*summary.summary_again(again), f"recording: {out}"]))
        return
    imported = import_logs(logs, told, load_arm(arm) if arm else None)
    arm_file = save_imported(imported, out, options)
    _tell(imported)
    print(f"recording: {out}\narm: {arm_file}")


def _tell(imported: "Imported") -> None:
    """What came of it, in a table and some lines."""
    from s2c2a.cli.console import print_table
    from s2c2a.logs.summary import cable_rows, summary

    header = ("drive", "module", "angle [deg]", "larger numbers", "gain over mean")
    print_table("Cables", header, cable_rows(imported), left_aligned=True)
    print("\n".join(summary(imported)))
