"""Experiments of `s2c2a reproduce` beyond the paper's tables."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, Events, print_results, progress_bar
from s2c2a.cli.dependent_options import beside
from s2c2a.cli.execution import ALL_CORES, NEW_FOLDER, Folder, Work, run_directory
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.arm import ArmSpec
    from s2c2a.evaluation.report import Row
    from s2c2a.jobs import Make

ComparedStrategy = Annotated[
    str, tyro.conf.arg(metavar="best|best-long|paper|pcc|pcc-fitted|FILE")
]


def randomized_arms(
    arms: int = 10,
    strengths: tuple[float, ...] = (0.5, 1.0),
    strategies: tuple[ComparedStrategy, ...] = ("best", "paper", "pcc", "pcc-fitted"),
    tasks: tuple[str, ...] = (),
    targets: int = 200,
    base: Arm = "twin_arm",
    seed: int = 0,
    reachable_from: float = 0.75,
    work: Work = ALL_CORES,
) -> None:
    """All strategies on arms with random model mismatch (docs/results/protocol.md).

    Data, training and tasks are repeated for each arm. Repeat the command to continue an
    interrupted run.

    Args:
        arms: number of arms at each strength, sampled as `s2c2a arm random` does, with
            seeds from zero.
        strengths: magnitudes of the mismatch.
        strategies: pcc and pcc-fitted are baselines; the others are recipes of the
            paper's strategy, by name or file.
        tasks: names of tasks, with a pace if it is not one: square@0.5. Without it:
            circle, the six tilts and hold-middle.
        targets: number of targets within reach, each held for five seconds, to find
            strategies that diverge; none if zero.
        base: a preset or an arm file: modules, cables, and all that the controllers
            know.
        seed: random seed of data, training and start.
        reachable_from: magnitude from which targets are moved within the reach of the
            randomized arm.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import randomized_arms as study

    compared = study.RandomizedArmsStudy(
        load_arm(base),
        arms,
        strengths,
        strategies,
        tasks or study.TASKS,
        targets,
        seed,
        reachable_from,
    )
    options = asdict(compared) | {"base": base}
    with _study(study.EXPERIMENT, options, work, as_table=True) as results:
        results.keep(study.randomized_arms_rows(compared, results.make))


@beside("random_arms", "strength")
def sensors(
    arm: Arm = "twin_arm",
    random_arms: int = 0,
    strength: float = 0.5,
    sets: tuple[str, ...] = (
        "encoders",
        "encoders-known-payload",
        "bends",
        "imu",
        "current",
        "camera",
        "flex",
        "imu-current-camera",
    ),
    payloads_g: tuple[float, ...] = (0.0, 50.0, 100.0),
    tasks: tuple[str, ...] = ("circle",),
    seeds: int = 1,
    event: Events = (),
    work: Work = ALL_CORES,
) -> None:
    """Tip errors under unknown payloads for sets of sensors (docs/guides/sensors.md).

    Networks are trained without payload, once for all sets except `flex`, whose sensor
    model is trained too. Repeat the command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        random_arms: number of randomized arms, sampled as `s2c2a arm random` does, to use
            instead of this arm; none if zero.
        strength: magnitude of their mismatch.
        sets: sets of sensors; encoders-known-payload is encoders and a known payload.
        payloads_g: masses at the tip [g].
        tasks: names of tasks.
        seeds: number of seeds, from zero.
        event: a disturbance during the run, such as "6 payload 0.05" or "10 sensor_loss";
            repeat the option for several (docs/guides/sensors.md).
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import sensors as study

    options = {
        "arm": arm,
        "random_arms": random_arms,
        "strength": strength,
        "sets": sets,
        "payloads_g": payloads_g,
        "tasks": tasks,
        "events": event,
        "seeds": seeds,
    }
    compared = study.SensorStudy(
        arms=study.randomized_arms(load_arm(arm), random_arms, strength),
        sets=sets,
        payloads=_kilograms(payloads_g),
        tasks=tasks,
        seeds=_seeds(seeds),
        strength=strength,
        events="; ".join(event),
    )
    title = f"sensors, {seeds} seeds"
    with _study(study.EXPERIMENT, options, work, title) as results:
        results.keep(study.sensor_rows(compared, results.make))


@beside("random_arms", "strengths")
def stability(
    arm: Arm = "twin_arm",
    random_arms: int = 3,
    strengths: tuple[float, ...] = (0.5, 1.0),
    sets: tuple[str, ...] = ("bends", "imu", "current", "camera"),
    payloads_g: tuple[float, ...] = (0.0, 50.0, 100.0, 150.0),
    seconds: float = 60.0,
    seeds: int = 1,
    work: Work = ALL_CORES,
) -> None:
    """Vibration over arms, sensors and payloads: held points, circles with a force.

    The payloads are unknown; encoders alone that know them are compared. Repeat the
    command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        random_arms: number of randomized arms at each strength, beside this arm.
        strengths: magnitudes of their mismatch.
        sets: sets of sensors.
        payloads_g: masses at the tip [g].
        seconds: for which each point is held.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import stability as study
    from s2c2a_experiments.sensors import randomized_arms

    base = load_arm(arm)
    arms = [base]
    if random_arms:
        for strength in strengths:
            arms += randomized_arms(base, random_arms, strength)
    compared = study.StabilityStudy(
        tuple(arms), sets, _kilograms(payloads_g), _seeds(seeds), seconds
    )
    options = asdict(compared) | {"arms": [one.name for one in arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        rows = study.stability_rows(compared, results.make)
        results.keep(rows)
    vibrating = study.vibrating(rows)
    print(f"{len(vibrating)} of {len(rows) // 2} runs move too much")


@beside("random_arms", "strength")
def motion(
    arm: Arm = "twin_arm",
    random_arms: int = 0,
    strength: float = 0.5,
    payload_g: float = 50.0,
    seeds: int = 3,
    work: Work = ALL_CORES,
) -> None:
    """Speed, ways of the tip, jumps of the target, and how smooth plans are.

    Repeat the command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        random_arms: number of randomized arms, sampled as `s2c2a arm random` does, to use
            instead of this arm; none if zero.
        strength: magnitude of their mismatch.
        payload_g: unknown mass at the tip, with inertial sensors, for the circle and the
            jumps [g]; none if zero.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import motion as study
    from s2c2a_experiments.sensors import randomized_arms

    arms = randomized_arms(load_arm(arm), random_arms, strength)
    (payload,) = _kilograms((payload_g,))
    moved = study.MotionStudy(arms, seeds=_seeds(seeds), payload=payload)
    options = asdict(moved) | {"arms": [one.name for one in arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.motion_rows(moved, results.make))


def scenes(
    arm: Arm = "twin_arm",
    drawn: int = 50,
    crossings: int = 20,
    unsolvable: int = 20,
    seeds: int = 1,
    work: Work = ALL_CORES,
) -> None:
    """Ways of the whole arm past obstacles: turned, drawn and unsolvable scenes, crossings.

    Repeat the command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        drawn: number of drawn scenes, each with a way.
        crossings: number of spheres that cross the way.
        unsolvable: number of drawn scenes that have no way.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import scenes as study

    passed = study.SceneStudy(
        load_arm(arm), drawn, crossings, unsolvable, _seeds(seeds)
    )
    options = asdict(passed) | {"arm": passed.arm.name}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.scene_rows(passed, results.make))


@beside("random_arms", "strength", "train_random_arms")
def reach(
    arm: Arm = "twin_arm",
    random_arms: int = 2,
    strength: float = 0.5,
    train_random_arms: bool = False,
    poses: int = 500,
    seed: int = 0,
    work: Work = ALL_CORES,
) -> None:
    """Reachability beside a long search: verdicts, misses, and time.

    Args:
        arm: a preset or an arm file; its networks are trained.
        random_arms: number of randomized arms, sampled as `s2c2a arm random` does, beside
            this arm.
        strength: magnitude of their mismatch.
        train_random_arms: train their networks, too; without it they bend as arcs.
        poses: number of poses of each arm.
        seed: of data, training, poses and starts.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import reach as study
    from s2c2a_experiments.sensors import randomized_arms

    base = load_arm(arm)
    arms = (base, *(randomized_arms(base, random_arms, strength)[:random_arms]))
    searched = study.ReachStudy(arms, train_random_arms, poses, seed)
    options = asdict(searched) | {"arms": [one.name for one in arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.reach_rows(searched, results.make))


@beside("random_arms", "strength")
def shapes(
    arm: Arm = "twin_arm",
    random_arms: int = 1,
    strength: float = 0.5,
    curves: int = 10,
    seeds: int = 1,
    work: Work = ALL_CORES,
) -> None:
    """Shapes of the whole arm: distance of the center line from drawn curves.

    Repeat the command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        random_arms: number of randomized arms beside this arm.
        strength: magnitude of their mismatch.
        curves: number of curves that the arm can take, and of those of another arm.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import shapes as study
    from s2c2a_experiments.sensors import randomized_arms

    arms = [load_arm(arm)]
    if random_arms:
        arms += randomized_arms(arms[0], random_arms, strength)
    taken = study.ShapeStudy(tuple(arms), curves, _seeds(seeds))
    options = asdict(taken) | {"arms": [one.name for one in arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.shape_rows(taken, results.make))


@beside("random_arms", "strength")
def repetition(
    arm: Arm = "twin_arm",
    random_arms: int = 3,
    strength: float = 1.0,
    tasks: tuple[str, ...] = ("circle",),
    repetitions: int = 5,
    turns: int = 3,
    seeds: int = 1,
    work: Work = ALL_CORES,
) -> None:
    """What a slow camera teaches, over runs (learning control) and within one.

    Repeat the command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        random_arms: number of randomized arms, sampled as `s2c2a arm random` does, to use
            instead of this arm; none if zero.
        strength: magnitude of their mismatch.
        tasks: names of tasks.
        repetitions: of each task.
        turns: of the circle in one run, with and without the camera; none if zero.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import repetition as study
    from s2c2a_experiments.sensors import randomized_arms

    arms = randomized_arms(load_arm(arm), random_arms, strength)
    repeated = study.RepetitionStudy(arms, tasks, repetitions, _seeds(seeds), turns)
    options = asdict(repeated) | {"arms": [one.name for one in arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.repetition_rows(repeated, results.make))


def data(
    arms: tuple[Arm, ...] = ("twin_arm", "simulated_arm"),
    arm_seeds: tuple[int, ...] = (31, 33, 32, 34),
    strengths: tuple[float, ...] = (0.5, 0.5, 1.0, 1.0),
    base: Arm = "twin_arm",
    kinds: tuple[str, ...] = ("coverage", "mixed", "coverage-mixed"),
    tasks: tuple[str, ...] = ("circle", "square", "tilt-50", "hold-middle"),
    seeds: int = 3,
    work: Work = ALL_CORES,
) -> None:
    """Kinds of babbling compared in closed loop, and the choice among them.

    A kind is chosen in place of the first one if its errors are smaller by two standard
    errors over the arms. Repeat the command to continue an interrupted run.

    Args:
        arms: presets or arm files, such as those that `s2c2a import` fits to recordings.
        arm_seeds: of randomized arms, as `s2c2a arm random` samples them.
        strengths: magnitude of the mismatch of each.
        base: of the randomized arms, a preset or an arm file.
        kinds: of babbling; the first is the one to beat.
        tasks: names of tasks.
        seeds: number of seeds, from zero; each sets data, training and start.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import data_choice as study

    drawn = _drawn_arms(base, arm_seeds, strengths)
    compared = study.DataStudy(
        (*map(load_arm, arms), *drawn), kinds, tasks, _seeds(seeds)
    )
    options = asdict(compared) | {"arms": [arm.name for arm in compared.arms]}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.data_rows(compared, results.make))
    print(f"chosen: {study.choice(results.rows, kinds)}")


def session(
    arm_seeds: tuple[int, ...] = (31, 33, 32),
    strengths: tuple[float, ...] = (0.5, 0.5, 1.0),
    task: str = "circle",
    base: Arm = "twin_arm",
    seed: int = 0,
    work: Work = ALL_CORES,
) -> None:
    """Moved frames, other homing and other stiffness, before and after a session.

    Repeat the command to continue an interrupted run (docs/guides/session.md).

    Args:
        arm_seeds: of randomized arms, as `s2c2a arm random` samples them.
        strengths: magnitude of the mismatch of each.
        task: name of a task.
        base: a preset or an arm file.
        seed: of data, training, start and days.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import session as study

    arms = _drawn_arms(base, arm_seeds, strengths)
    options = {"arms": [one.name for one in arms], "task": task, "seed": seed}
    with _study(study.EXPERIMENT, options, work) as results:
        changed = study.SessionStudy(arms, task, seed, results.directory)
        results.keep(study.session_rows(changed, results.make))


def sensor_faults(
    arm: Arm = "twin_arm",
    sets: tuple[str, ...] = ("encoders", "bends", "imu", "current", "camera"),
    faults: tuple[str, ...] = (
        "drift",
        "latency",
        "noise",
        "offset",
        "negated",
        "zeros",
        "frozen",
        "reversed",
    ),
    seconds: tuple[float, ...] = (5.0,),
    payload_g: float = 50.0,
    seeds: int = 1,
    work: Work = ALL_CORES,
) -> None:
    """Errors on the circle while a sensor is faulty, from 8 s on.

    Every fault is also kept to the end of the run. Repeat the command to continue an
    interrupted run.

    Args:
        arm: a preset or an arm file.
        sets: sets of sensors, of which all fail together.
        faults: kinds of faults.
        seconds: durations of the faults.
        payload_g: unknown mass at the tip [g].
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments import sensor_faults as study

    durations = (*seconds, float("inf"))
    compared = study.SensorFaultStudy(
        load_arm(arm), sets, faults, durations, payload_g / 1000, _seeds(seeds)
    )
    options = asdict(compared) | {"arm": arm}
    with _study(study.EXPERIMENT, options, work) as results:
        results.keep(study.sensor_fault_rows(compared, results.make))


def real(
    recording: tyro.conf.Positional[Path],
    unseen: tuple[Path, ...] = (),
    block: int = 25,
    episodes: int = 0,
    last: int = 0,
    largest: float = 0.0,
    gap: int = 25,
    models: tuple[str, ...] = (),
    seeds: int = 1,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Forward models on recordings of real arms, such as `s2c2a import` writes.

    Held-out rows are not used in training. Hysteresis states are propagated along the
    whole recording.

    Args:
        recording: training data.
        unseen: other recordings of the same arm, used for testing only, after a separate
            training on all rows.
        block: hold out the 7th, 14th and 20th of every twenty blocks of so many rows;
            none if zero.
        episodes: hold out the last one of every so many episodes, in a separate
            training; none if zero.
        last: hold out so many last rows of every episode, in a separate training; none
            if zero.
        largest: hold out this share of the rows, those with the largest pulls, in a
            separate training, such as 0.15; none if zero.
        gap: rows on either side of held-out ones that are not used at all: neighbors in
            time are alike.
        models: names of models; all by default.
        seeds: number of training seeds, from zero.
        folder: run directory.
    """
    from s2c2a_experiments.real import EXPERIMENT, RealComparison, real_rows

    study = RealComparison.of(
        recording, unseen, block, last, models, largest, gap, episodes
    )
    options = {
        "recording": str(recording),
        "unseen": [str(path) for path in unseen],
        "block": block,
        "episodes": episodes,
        "last": last,
        "largest": largest,
        "gap": gap,
        "models": models,
        "seeds": seeds,
    }
    with (
        _study(EXPERIMENT, options, folder, resume=False, as_table=True) as results,
        progress_bar() as progress,
    ):
        results.keep(real_rows(study, range(seeds), progress, results.keep))


def open_loop(
    recording: tyro.conf.Positional[Path],
    block: int = 25,
    gap: int = 25,
    seeds: int = 1,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Predictions of a second without measurements: at rest, with vibration, linear.

    Args:
        recording: training data, and held-out blocks that are predicted.
        block: hold out the 7th, 14th and 20th of every twenty blocks of so many rows.
        gap: rows on either side of held-out ones that are not used at all.
        seeds: number of training seeds, from zero.
        folder: run directory.
    """
    from s2c2a.data import load_recording
    from s2c2a_experiments.open_loop import EXPERIMENT, open_loop_rows
    from s2c2a_experiments.real import split_blocks

    recorded = load_recording(recording)
    split = split_blocks(recorded, block)
    options = {"recording": str(recording), "block": block, "gap": gap, "seeds": seeds}
    with _study(EXPERIMENT, options, folder, resume=False, as_table=True) as results:
        results.keep(open_loop_rows(recorded, split, gap, range(seeds)))


def payloads(
    weights: tyro.conf.Positional[Path],
    recordings: tyro.conf.Positional[tuple[Path, ...]],
    seen: float = 20.0,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Payload estimation on recordings of real arms.

    The networks are trained without payload. The state estimator uses the encoders
    and, for the first seconds, the tip position.

    Args:
        weights: networks from `s2c2a train`, trained on a recording without payload.
        recordings: recordings of the same arm with a payload, imported with --like the
            first.
        seen: time in which the tip position is measured [s].
        folder: run directory.
    """
    from s2c2a.data import load_recording
    from s2c2a.strategies import load_networks
    from s2c2a_experiments.payloads import EXPERIMENT, payload_rows

    loaded = {str(path.with_suffix("")): load_recording(path) for path in recordings}
    options = {
        "weights": weights,
        "recordings": [str(path) for path in recordings],
        "seen": seen,
    }
    title = f"payloads, tip measured for {seen:g} s"
    networks = load_networks(weights)
    with _study(EXPERIMENT, options, folder, title, resume=False) as results:
        results.keep(payload_rows(networks, loaded, seen, results.keep))


def plans(
    weights: tuple[Path, ...] = (),
    count: int = 10_000,
    seed: int = 0,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Random planning problems compared with a long search.

    Reports the share of plans that are stuck although their cost could decrease.

    Args:
        weights: files of networks; those of the package by default.
        count: number of problems for each.
        seed: random seed of the problems.
        folder: run directory.
    """
    from s2c2a import strategies
    from s2c2a.jobs.circle import ARMS
    from s2c2a_experiments.plans import plan_rows

    networks = [strategies.load_networks(path) for path in weights]
    if not networks:
        networks = [strategies.shipped_networks(load_arm(name)) for name in ARMS]
    options = {"weights": weights, "count": count, "seed": seed}
    title = f"{count} plans compared with a long search"
    with _study("plans", options, folder, title, resume=False) as results:
        results.keep(plan_rows(networks, count, seed, results.keep))


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
    folder: Folder,
    title: str = "",
    *,
    resume: bool = True,
    as_table: bool = False,
) -> Iterator[_Results]:
    """Open the run directory of a study, and print the rows that are kept in it.

    Of several arms, their means and the worst are printed; the files have all rows.
    """
    with run_directory(name, dict(options), folder, resume=resume) as (directory, make):
        results = _Results(directory, make, name if as_table else "")
        yield results
    rows = results.rows
    averages = [row for row in rows if " arms at " in row.arm]
    print_results(title or name, averages or rows, [], directory)
    if as_table:
        print(f"table: {directory / name}.md (.csv, .tex, .json next to it)")


def _drawn_arms(
    base: str, seeds: Sequence[int], strengths: Sequence[float]
) -> "tuple[ArmSpec, ...]":
    """Randomized arms, one for each seed and strength."""
    from s2c2a.arm import randomized_arm

    if len(seeds) != len(strengths):
        raise S2C2AError(
            f"{len(seeds)} --arm-seeds and {len(strengths)} --strengths were given; give "
            "one strength for each seed"
        )
    nominal = load_arm(base)
    pairs = zip(seeds, strengths, strict=True)
    return tuple(randomized_arm(nominal, *pair) for pair in pairs)


def _seeds(count: int) -> tuple[int, ...]:
    from s2c2a.jobs import checked_seeds

    return tuple(checked_seeds(0, count))


def _kilograms(payloads_g: Sequence[float]) -> tuple[float, ...]:
    return tuple(payload / 1000 for payload in payloads_g)
