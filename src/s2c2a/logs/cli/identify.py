"""Command `s2c2a identify`: fit an arm file to a recording (system identification)."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import (
    Arm,
    Count,
    FidelityName,
    OptionalNumber,
    print_table,
    progress_bar,
)
from s2c2a.cli.execution import make_executor
from s2c2a.errors import ArmError, S2C2AError, counted
from s2c2a.files.text import check_replaceable, write_atomically

if TYPE_CHECKING:
    from s2c2a.episodes import Episode
    from s2c2a.logs.identification import Fit, TipErrors

SETTLING_TIME = 0.1  # s; a light arm is then at rest
DEFAULT_ROWS = 400
InitialGuess = Annotated[
    Arm,
    tyro.conf.arg(
        help="initial guess: a preset or an arm file, such as the one of `s2c2a import`."
    ),
]
Groups = Annotated[tuple[str, ...], tyro.conf.arg(metavar="GROUP ...")]


def identify(
    recording: tyro.conf.Positional[Path],
    arm: InitialGuess,
    out: Path,
    fit: Groups = (),
    on: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RECORDING ...")] = (),
    settling: OptionalNumber = None,
    rows: Count = None,
    rounds: int = 12,
    fidelity: FidelityName = "fast",
    jobs: Count = None,
    overwrite: bool = False,
) -> None:
    """Fit the simulated arm to a recording, and write its arm file (docs/guides/identify.md).

    Every fifth block of 25 rows is held out, and the error is reported on these. An
    interrupted fit writes the best arm so far; continue with that file as --arm.

    Args:
        recording: recording of the arm with measured module ends, at least the tip.
        out: the arm file to write.
        fit: groups of parameters to fit (docs/guides/identify.md); by default those that most
            recordings determine.
        on: other recordings of the same arm, on which to report the error too.
        settling: time for which the simulation holds each action [s], for recordings
            whose rows are all at rest. By default 0.1 if `s2c2a import` recorded this;
            otherwise rows follow each other at the recorded rate.
        rows: maximum number of rows to fit, evenly spaced, for recordings at rest; 400
            by default.
        rounds: maximum number of iterations.
        jobs: parallel simulations, all cores by default; the result is the same.
        overwrite: replace the arm file if it exists.
    """
    from s2c2a import data
    from s2c2a.logs import identification

    check_replaceable(out, ".toml", ArmError, overwrite)
    groups = fit or identification.USUAL
    start = identification.with_default_starts(load_arm(arm), groups)
    recorded = data.load_recording(recording)
    if settling is None and recorded.options.get("at_rest"):
        settling = SETTLING_TIME
    if rows is not None and rows < 1:
        raise S2C2AError(
            f"--rows is {rows}; take at least 1, or leave it out for {DEFAULT_ROWS}"
        )
    if rows is not None and settling is None:
        raise S2C2AError(
            "--rows leaves rows out, which needs a recording whose rows are all at "
            "rest: say --settling too"
        )
    others = {str(path): data.load_recording(path) for path in on}
    for tested in (recorded, *others.values()):
        layouts = _layout(start), _layout(tested.arm)
        if layouts[0] != layouts[1]:
            raise ArmError(
                f"{start.name} is {layouts[0]}; the recorded arm is {layouts[1]}: give "
                "the arm that was recorded"
            )
    options = identification.options_for(recorded, settling, rounds, fidelity)
    parameters = identification.unknowns_of(start, groups, moving=settling is None)
    episodes: Sequence[Episode] = recorded.episodes
    if settling is not None:
        episodes = identification.thinned(episodes, rows or DEFAULT_ROWS)
    with make_executor(jobs) as executor, progress_bar() as progress:
        result = identification.identify(
            start, parameters, episodes, options, executor, progress
        )
    errors = identification.errors_of(
        result, {name: other.episodes for name, other in others.items()}
    )
    remark = "\n".join(
        [f"Fitted to {recording.name} by `s2c2a identify`.", *_describe(errors)]
    )
    write_atomically(identification.fitted_toml(result, remark), out, ArmError)
    _print_result(result, errors)
    print(f"arm: {out}")


def _layout(arm: ArmSpec) -> str:
    return (
        f"driven by {arm.actuation}, {counted(arm.module_count, 'module')} of "
        f"{counted(arm.cable_count, 'cable')}"
    )


def _describe(errors: "dict[str, TipErrors]") -> list[str]:
    """One line of tip errors for each recording."""
    return [
        f"{name} ({tip.rows}): tip error mean {1e3 * tip.mean:.1f} mm, "
        f"rms {1e3 * tip.rms:.1f} ({1e3 * tip.rms_centered:.1f} about its mean), "
        f"95 % below {1e3 * tip.most:.1f}"
        for name, tip in errors.items()
    ]


def _print_result(result: "Fit", errors: "dict[str, TipErrors]") -> None:
    """Print fitted parameters, unidentifiable combinations and errors."""
    from s2c2a.logs.identification import fitted_numbers, undetermined_combinations

    rows = [
        (
            number.name,
            f"{number.start:.5g}",
            f"{number.value:.5g}",
            f"{number.deviation:.2g}",
            "" if number.seen else "poorly identifiable",
        )
        for number in fitted_numbers(result)
    ]
    header = ("parameter", "start", "fitted", "+-", "")
    print_table("Fitted parameters (SI units, deg)", header, rows, left_aligned=True)
    if combinations := undetermined_combinations(result.posterior):
        print("Poorly identifiable combinations (the prior outweighs the recording):")
        for combination in combinations:
            print(f"  {combination}")
    for line in _describe(errors):
        print(line)
    if not result.finished:
        print(
            "the fit has not converged: continue with the fitted arm as --arm, or with "
            "more --rounds"
        )
