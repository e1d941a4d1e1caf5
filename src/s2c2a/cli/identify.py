"""`s2c2a identify`: an arm file fitted to a recording, so that the simulation is that arm's twin."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import Arm, FidelityName, print_table, progress_bar
from s2c2a.cli.execution import executor_for
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.files import save_whole

if TYPE_CHECKING:
    from s2c2a.identification import Fit, TipErrors

SETTLING = 0.1  # s: a light arm is at rest then
ENOUGH_ROWS = 400
Groups = Annotated[tuple[str, ...], tyro.conf.arg(metavar="GROUP ...")]


def identify(
    recording: tyro.conf.Positional[Path],
    arm: Arm,
    out: Path,
    fit: Groups = (),
    on: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RECORDING ...")] = (),
    settling: float | None = None,
    rows: int | None = None,
    rounds: int = 12,
    fidelity: FidelityName = "fast",
    jobs: int | None = None,
    overwrite: bool = False,
) -> None:
    """Fit the simulated arm to a recording, and write the arm file of this twin (docs/identify.md).

    Every fifth stretch of 25 rows is kept from the fit, and the twin's error is said of
    it. Interrupted, it writes the best so far; go on by giving that file as --arm.

    Args:
        recording: of the arm; its ends must have been seen, at least the tip.
        arm: the start: a preset or an arm file, such as the one that `s2c2a import` has
            found.
        out: the arm file to write.
        fit: what is fitted (docs/identify.md); what most recordings show if not stated.
        on: other recordings of the same arm, on which the twin's error is said too.
        settling: seconds that an action is held in the simulation; give it where every
            row is a shape at rest. If not stated, 0.1 where `s2c2a import` was told so,
            and elsewhere rows are as far apart as in the recording.
        rows: rows that are fitted at most, evenly spread; only where all are at rest.
            400 of them if not stated.
        rounds: steps of the fit at most.
        fidelity: of the simulation.
        jobs: simulations side by side; all cores if not stated. The result is the same.
        overwrite: replace the arm file if it exists.
    """
    from s2c2a import data, identification

    if out.exists() and not overwrite:
        raise ArmError(
            f"{out} exists; choose another name or overwrite it (--overwrite)"
        )
    groups = fit or identification.USUAL
    start = identification.stated_for(load_arm(arm), groups)
    recorded = data.load_recording(recording)
    settling = (
        SETTLING if settling is None and recorded.options.get("at_rest") else settling
    )
    if rows is not None and rows < 1:
        raise S2C2AError(
            f"--rows {rows} was asked for; take at least one, or leave it out for {ENOUGH_ROWS}"
        )
    if rows is not None and settling is None:
        raise S2C2AError(
            "--rows leaves rows out, which is possible where every one is at rest: say --settling too"
        )
    others = {str(path): data.load_recording(path) for path in on}
    for one in (recorded, *others.values()):
        _check_alike(start, one.arm)
    options = identification.options_for(recorded, settling, rounds, fidelity)
    disturbances = identification.unknowns_of(start, groups, moving=settling is None)
    episodes = (
        recorded.episodes
        if settling is None
        else identification.thinned(recorded.episodes, rows or ENOUGH_ROWS)
    )
    with executor_for(jobs) as executor, progress_bar() as progress:
        found = identification.identify(
            start, disturbances, episodes, options, executor, progress
        )
    errors = identification.errors_of(
        found, {name: one.episodes for name, one in others.items()}
    )
    save_whole(
        identification.fitted_toml(found, _remark(recording, errors)), out, ArmError
    )
    _tell(found, errors)
    print(f"arm: {out}")


def _check_alike(start: ArmSpec, recorded: ArmSpec) -> None:
    """Rows of a recording have to fit the arm that replays them."""
    forms = [
        (one.actuation, one.module_count, one.cable_count) for one in (start, recorded)
    ]
    if forms[0] != forms[1]:
        said = [
            f"driven by {actuation}, {modules} modules of {cables} cables"
            for actuation, modules, cables in forms
        ]
        raise ArmError(
            f"{start.name} is {said[0]}; what was recorded is {said[1]}: give the arm that was recorded"
        )


def _remark(recording: Path, errors: "dict[str, TipErrors]") -> str:
    return "\n".join(
        [
            f"Fitted to {recording.name} by `s2c2a identify`.",
            *map(_in_words, errors, errors.values()),
        ]
    )


def _in_words(of: str, errors: "TipErrors") -> str:
    numbers = [
        1e3 * one for one in (errors.mean, errors.rms, errors.rms_centered, errors.most)
    ]
    said = "tip error mean {:.1f} mm, rms {:.1f} ({:.1f} about its mean), 95 % below {:.1f}".format(
        *numbers
    )
    return f"{of} ({errors.rows}): {said}"


def _tell(found: "Fit", errors: "dict[str, TipErrors]") -> None:
    """Numbers, what cannot be told apart, and errors."""
    from s2c2a.identification import found_numbers, untold

    rows = [
        (
            one.name,
            f"{one.start:.5g}",
            f"{one.value:.5g}",
            f"{one.deviation:.2g}",
            "" if one.seen else "hardly seen",
        )
        for one in found_numbers(found)
    ]
    print_table(
        "What was fitted (SI units, deg)",
        ("number", "start", "fitted", "+-", ""),
        rows,
        left_aligned=True,
    )
    if combinations := untold(found.belief):
        print(
            "The recording says less than the start did of (in what each may be off by):"
        )
        print("".join(f"  {one}\n" for one in combinations), end="")
    print("\n".join(map(_in_words, errors, errors.values())))
    if not found.finished:
        print(
            "it could fall further: go on with the fitted arm as --arm, or with more --rounds"
        )
