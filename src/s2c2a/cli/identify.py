"""`s2c2a identify`: an arm file fitted to a recording, so that the simulation is that arm's twin."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import Arm, FidelityName, print_table, progress_bar
from s2c2a.cli.work import ALL_CORES, executor_for
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.files import save_whole

if TYPE_CHECKING:
    from s2c2a.data import Recording
    from s2c2a.identification import Fit, FitOptions, TipErrors

Groups = Annotated[tuple[str, ...], tyro.conf.arg(metavar="GROUP ...")]
UNLIMITED = 10**9


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

    Every fifth stretch of 25 rows is kept from the fit, and the twin's error is said of it. Interrupted, it writes the
    best so far; go on by giving that file as --arm.

    Args:
        recording: of the arm; its ends must have been seen, at least the tip.
        arm: the start: a preset or an arm file, such as the one that `s2c2a import` has found.
        out: the arm file to write.
        fit: what is fitted; all that the arm file has and the recording can show if not stated.
        on: other recordings of the same arm, on which the twin's error is said too.
        settling: seconds that an action is held in the simulation; give it where every row is a shape at rest. If not
            stated, rows are as far apart as in the recording.
        rows: rows that are fitted at most, evenly spread; only with --settling. All of them if not stated.
        rounds: steps of the fit at most.
        fidelity: of the simulation.
        jobs: simulations side by side; all cores if not stated. The result is the same.
        overwrite: replace the arm file if it exists.
    """
    from s2c2a import data, identification

    if out.exists() and not overwrite:
        raise ArmError(f"{out} exists; choose another name or overwrite it (--overwrite)")
    if rows is not None and settling is None:
        raise S2C2AError("--rows leaves rows out, which is only possible where every row is at rest: say --settling too")
    start, recorded = load_arm(arm), data.load_recording(recording)
    _check_alike(start, recorded.arm)
    options = _options_for(recorded, settling, rounds, fidelity)
    unknowns = identification.unknowns_of(start, fit or identification.USUAL, moving=settling is None)
    episodes = identification.thinned(recorded.episodes, rows or UNLIMITED)
    with executor_for(jobs) as executor, progress_bar() as progress:
        found = identification.identify(start, unknowns, episodes, options, executor, progress)
    _tell(found)
    errors = {"fitted rows": found.errors()[0], "held-out rows": found.errors()[1]}
    errors |= {path.name: identification.errors_on(found, data.load_recording(path).episodes) for path in on}
