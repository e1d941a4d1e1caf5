"""Experiments of `s2c2a reproduce` beyond the paper's tables."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from s2c2a.arm import load_arm, randomized_arm
from s2c2a.cli.console import print_results, progress_bar
from s2c2a.cli.execution import ALL_CORES, Work, run_directory
from s2c2a.errors import counted

if TYPE_CHECKING:
    from s2c2a.evaluation.report import Row
    from s2c2a.jobs import Make

PATHS = ("circle", "square", "eight", "circle@0.5", "square@0.5", "eight@0.5")


def _ingredients(seeds: int = 3, arm: str = "twin_arm", work: Work = ALL_CORES) -> None:
    from s2c2a_experiments.table_files import save_across
    from s2c2a_experiments.tables import ablation_rows

    options = {"seeds": seeds, "arm": arm}
    with run_directory("ingredients", options, work, resume=True) as (directory, make):
        rows = ablation_rows(_seeds(seeds), make, arm)
    print(save_across("ingredients", rows, directory).read_text(encoding="utf-8"))


def _randomized_arms(
    settings: Mapping[str, Any], arm: str = "twin_arm", work: Work = ALL_CORES
) -> None:
    from s2c2a_experiments import randomized_arms as study

    compared = study.RandomizedArmsStudy(load_arm(arm), **settings)
    options = asdict(compared) | {"base": arm}
    with _study(study.EXPERIMENT, options, work, as_table=True) as results:
        results.keep(study.randomized_arms_rows(compared, results.make))


def _sensors(arm: str = "twin_arm", seeds: int = 3, work: Work = ALL_CORES) -> None:
    """Networks are trained without payload, once for all sets except `flex`.

    The payloads are unknown; encoders alone that know them are compared.
    """
    from s2c2a_experiments import sensors as study

    compared = study.SensorStudy(load_arm(arm), seeds=_seeds(seeds))
    _make(
        study.EXPERIMENT,
        compared,
        study.sensor_rows,
        work,
        f"sensors, {counted(seeds, 'seed')}",
    )


def _stability(arm: str = "twin_arm", seeds: int = 1, work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import stability as study

    base = load_arm(arm)
    arms = (base, randomized_arm(base, 0, 0.5))
    compared = study.StabilityStudy(arms, seeds=_seeds(seeds))
    rows = _make(study.EXPERIMENT, compared, study.stability_rows, work)
    vibrating = study.vibrating(rows)
    print(f"{len(vibrating)} of {len(rows) // 2} runs move too much")


def _motion(arm: str = "twin_arm", seeds: int = 3, work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import motion as study

    moved = study.MotionStudy((load_arm(arm),), seeds=_seeds(seeds))
    _make(study.EXPERIMENT, moved, study.motion_rows, work)


def _randomized_motion(
    arm: str = "twin_arm", seeds: int = 2, work: Work = ALL_CORES
) -> None:
    """Randomized arms carry no payload."""
    from s2c2a_experiments import motion as study

    arms = tuple(randomized_arm(load_arm(arm), seed, 0.5) for seed in range(2))
    moved = study.MotionStudy(arms, seeds=_seeds(seeds), payload=0.0)
    _make(study.EXPERIMENT, moved, study.motion_rows, work)


def _scenes(arm: str = "twin_arm", seeds: int = 3, work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import scenes as study

    passed = study.SceneStudy(load_arm(arm), seeds=_seeds(seeds))
    _make(study.EXPERIMENT, passed, study.scene_rows, work)


def _reach(arm: str = "twin_arm", work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import reach as study

    base = load_arm(arm)
    searched = study.ReachStudy((base, randomized_arm(base, 0, 0.5)))
    _make(study.EXPERIMENT, searched, study.reach_rows, work)


def _shapes(arm: str = "twin_arm", seeds: int = 1, work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import shapes as study

    base = load_arm(arm)
    taken = study.ShapeStudy((base, randomized_arm(base, 0, 0.5)), seeds=_seeds(seeds))
    _make(study.EXPERIMENT, taken, study.shape_rows, work)


def _repetition(arm: str = "twin_arm", seeds: int = 1, work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import repetition as study

    arms = tuple(randomized_arm(load_arm(arm), seed, 1.0) for seed in range(3))
    repeated = study.RepetitionStudy(arms, seeds=_seeds(seeds))
    _make(study.EXPERIMENT, repeated, study.repetition_rows, work)


def _sensor_faults(
    arm: str = "twin_arm", seeds: int = 1, work: Work = ALL_CORES
) -> None:
    from s2c2a_experiments import sensor_faults as study

    compared = study.SensorFaultStudy(load_arm(arm), seeds=_seeds(seeds))
    _make(study.EXPERIMENT, compared, study.sensor_fault_rows, work)


def _session(arm: str = "twin_arm", work: Work = ALL_CORES) -> None:
    from s2c2a_experiments import session as study

    base = load_arm(arm)
    drawn = ((31, 0.5), (33, 0.5), (32, 1.0))
    arms = tuple(randomized_arm(base, *pair) for pair in drawn)
    changed = study.SessionStudy(arms)
    options = asdict(changed) | {"arms": [one.name for one in arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        study.session_rows(changed, results.directory, results.make, results.keep)


def _real(files: Sequence[Path], seeds: int = 1, work: Work = ALL_CORES) -> None:
    """The first recording trains; others of the same arm only test, by another training."""
    from s2c2a_experiments.real import EXPERIMENT, RealComparison, real_rows

    study = RealComparison.of(files[0], files[1:])
    options = {"recordings": [str(path) for path in files], "seeds": seeds}
    with (
        _study(EXPERIMENT, options, work, resume=False, as_table=True) as results,
        progress_bar() as progress,
    ):
        results.keep(real_rows(study, range(seeds), progress, results.keep))


def _payloads(files: Sequence[Path], work: Work = ALL_CORES) -> None:
    """Weights that are trained without payload, then recordings of the same arm with one.

    The state estimator uses the encoders and, for the first seconds, the tip position.
    """
    from s2c2a.strategies import load_networks
    from s2c2a_experiments.payloads import EXPERIMENT, SEEN, payload_rows
    from s2c2a_experiments.real import recordings_by_name

    weights, *recordings = files
    loaded = recordings_by_name(recordings)
    options = {"weights": weights, "recordings": [str(path) for path in recordings]}
    title = f"payloads, tip measured for {SEEN:g} s"
    networks = load_networks(weights)
    with _study(EXPERIMENT, options, work, title, resume=False) as results:
        results.keep(payload_rows(networks, loaded, SEEN, results.keep))


PATHS_ALONE: dict[str, Any] = {"strategies": ("best",), "tasks": PATHS, "targets": 0}
RANDOMIZED: dict[str, tuple[str, dict[str, Any]]] = {
    "randomised-arms": (
        "all strategies on arms with random model mismatch, of strength 0.5",
        {"arms": 10, "strength": 0.5},
    ),
    "randomised-arms-strong": (
        "randomised-arms with arms of strength 1",
        {
            "arms": 3,
            "strength": 1.0,
            "strategies": ("best", "best-long", "paper", "pcc-fitted"),
        },
    ),
    "randomised-arms-paths": (
        "paths at two paces, strength 0.5",
        PATHS_ALONE | {"arms": 4, "strength": 0.5},
    ),
    "randomised-arms-paths-strong": (
        "paths at two paces, strength 1",
        PATHS_ALONE | {"arms": 2, "strength": 1.0},
    ),
}
TABLES: dict[str, tuple[str, Callable[..., None]]] = {
    "ingredients": ("ablation study of the recipe `best`", _ingredients),
    "sensors": ("tip errors under unknown payloads for sets of sensors", _sensors),
    "sensor-faults": (
        "errors on the circle while a sensor is faulty",
        _sensor_faults,
    ),
    "stability": ("vibration over arms, sensors and payloads", _stability),
    "motion": (
        "speed, ways of the tip, jumps of the target, and how smooth plans are",
        _motion,
    ),
    "motion-randomised": ("the same on two randomized arms", _randomized_motion),
    "scenes": (
        "ways of the whole arm past obstacles: turned, drawn and unsolvable scenes",
        _scenes,
    ),
    "shapes": ("distance of the center line from drawn curves", _shapes),
    "reach": ("reachability beside a long search: verdicts, misses, time", _reach),
    "repetition": ("what a slow camera teaches, over runs and within one", _repetition),
    "session": (
        "moved frames, other homing and stiffness, before and after a session",
        _session,
    ),
    "real": (
        "forward models on real arms; FILE ...: a recording, and others to test on",
        _real,
    ),
    "payloads": (
        "estimated payloads of a real arm; FILE ...: weights, then recordings",
        _payloads,
    ),
}
"""Name -> summary, and a function whose parameters are the options that it takes."""
for _name, (_summary, _settings) in RANDOMIZED.items():
    TABLES[_name] = (_summary, partial(_randomized_arms, _settings))


@dataclass
class _Results:
    """Rows of a study in its run directory.

    Attributes:
        directory: the run directory.
        make: loads or makes runs, networks and recordings.
        table: name of the table's files; of `results.json` alone if empty.
        rows: that are kept.
    """

    directory: Path
    make: "Make"
    table: str
    rows: "Sequence[Row]" = ()

    def keep(self, rows: "Sequence[Row]") -> None:
        """Save all rows so far, so that an interruption loses none."""
        from s2c2a.evaluation.report import save_rows
        from s2c2a_experiments.table_files import save_table

        self.rows = rows
        if self.table:
            save_table(self.table, rows, self.directory)
        else:
            save_rows(rows, self.directory / "results.json")


@contextmanager
def _study(
    name: str,
    options: Mapping[str, Any],
    work: Work,
    title: str = "",
    *,
    resume: bool = True,
    as_table: bool = False,
) -> Iterator[_Results]:
    """Open the run directory of a study, and print the rows that are kept in it.

    Of several arms, their means and the worst are printed; the files have all rows.
    """
    with run_directory(name, dict(options), work, resume=resume) as (directory, make):
        results = _Results(directory, make, name if as_table else "")
        yield results
    rows = results.rows
    averages = [row for row in rows if " arms at " in row.arm]
    print_results(title or name, averages or rows, [], directory)
    if as_table:
        print(f"table: {directory / name}.md (.csv, .json next to it)")


def _make(
    name: str,
    compared: Any,
    rows_of: "Callable[[Any, Make], Sequence[Row]]",
    work: Work,
    title: str = "",
) -> "Sequence[Row]":
    """Make the rows of a study; its settings are recorded, its arms by their names."""
    options = asdict(compared)
    if "arms" in options:
        options["arms"] = [arm.name for arm in compared.arms]
    else:
        options["arm"] = compared.arm.name
    with _study(name, options, work, title) as results:
        results.keep(rows_of(compared, results.make))
    return results.rows


def _seeds(count: int) -> tuple[int, ...]:
    from s2c2a.jobs import checked_seeds

    return tuple(checked_seeds(0, count))
