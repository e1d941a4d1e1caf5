"""Command `s2c2a import`: convert logs of an arm to a recording and an arm file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import OptionalPath, print_table, progress_bar
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.logs import Imported, ImportedTake

LOADING = "loading the program"
ArmFile = Annotated[str | None, tyro.conf.arg(metavar="PRESET|FILE")]


def import_(
    logs: tyro.conf.Positional[tuple[Path, ...]],
    map: Path,
    out: Path,
    arm: ArmFile = None,
    like: OptionalPath = None,
    overwrite: bool = False,
) -> None:
    """Convert logs to a recording (docs/guides/import.md).

    A map file describes the columns. The command identifies the arm and writes its arm
    file next to the recording, with the uncertainty of each number; with --like, it
    writes the recording alone.

    Args:
        logs: files of measurements: text, JSON lines, NPZ, MAT, XLSX, Parquet, bags,
            folders of LeRobotDatasets, or exports of motion capture. Each is one
            take, unless the map joins several.
        map: description of the columns (TOML).
        out: the recording, such as mine.episodes.
        arm: use this arm, and match its cables with those of the logs, instead of
            identifying the arm.
        like: an earlier import of the same arm with the same cameras; take its frame,
            cables and arm.
        overwrite: replace the recording and the arm file if they exist.
    """
    with progress_bar() as progress:
        progress(LOADING, 0, 1)
        from s2c2a.data import load_recording
        from s2c2a.logs import (
            import_logs,
            import_take,
            load_map,
            save_imported,
            summary,
        )

        progress(LOADING, 1, 1)
        _check_arguments(logs, out, arm, like, overwrite)
        log_map = load_map(map)
        if like:
            repeated = import_take(logs, log_map, load_recording(like))
        else:
            known = load_arm(arm) if arm else None
            imported = import_logs(logs, log_map, known, progress)
    options = {
        "map": map.name,
        "logs": [path.name for path in logs],
        **log_map.source.model_dump(),
    }
    if like:
        save_imported(repeated, out, options)
        print("\n".join([*summary.take_summary(repeated), f"recording: {out}"]))
        _draw_ends(repeated, out)
        _draw_coverage(out)
        return
    arm_file = save_imported(imported, out, options)
    header = ("drive", "module", "angle [deg]", "larger numbers", "gain over mean")
    print_table("Cables", header, summary.cable_rows(imported), left_aligned=True)
    print("\n".join(summary.summary(imported)))
    print(f"recording: {out}\narm: {arm_file}")
    _draw_ends(imported, out)
    _draw_coverage(out)
    print(summary.verdict(imported))


def _draw_ends(imported: "Imported | ImportedTake", out: Path) -> None:
    """Draw the measured ends, what is excluded, and motions of the frame."""
    from s2c2a.logs.measured_ends import RowMark, measured_ends_figure

    excluded = imported.segments.excluded
    marks = []
    notes = []
    for motion in imported.segments.frame_motions:
        notes.append(motion.text)
        if motion.row >= 0:
            first = int((excluded.ends.stretches < motion.log).sum())
            marks.append(RowMark(first + motion.row, "jump of the frame"))
    figure = measured_ends_figure(
        excluded.ends,
        excluded.modules,
        excluded.outliers,
        marks,
        notes,
        Path(f"{out}.ends.png"),
    )
    print(f"measured ends: {figure}")


def _draw_coverage(out: Path) -> None:
    """Draw which configurations and speeds the new recording contains."""
    from s2c2a.cli.console import draw_coverage
    from s2c2a.data import load_recording

    if figure := draw_coverage(load_recording(out), out):
        print(f"coverage: {figure}")


def _check_arguments(
    logs: tuple[Path, ...],
    out: Path,
    arm: str | None,
    like: Path | None,
    overwrite: bool,
) -> None:
    from s2c2a.logs import arm_file_of

    if out.suffix != ENDING:
        raise S2C2AError(
            f"{out}: recordings end in {ENDING}; say --out "
            f"{out.with_suffix(ENDING).name}"
        )
    if not logs:
        raise S2C2AError(
            "no logs given; write: s2c2a import LOG... --map FILE --out FILE"
        )
    if arm and like:
        raise S2C2AError(
            "--arm and --like exclude each other, since --like takes the arm of its "
            "recording; leave --arm out"
        )
    existing = [path for path in (out, arm_file_of(out)) if path.exists()]
    if existing and not overwrite:
        raise S2C2AError(
            f"{existing[0]} exists; choose another name, or say --overwrite"
        )
    if like and (arm_file_of(out).exists() or out.resolve() == like.resolve()):
        raise S2C2AError(
            f"{out} is the recording of --like, or has an arm file of its own; choose "
            "another name for --out"
        )
