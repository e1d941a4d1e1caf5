"""Experiments of `s2c2a reproduce` beyond the paper's tables."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, Events, print_results, progress_bar
from s2c2a.cli.dependent_options import beside
from s2c2a.cli.execution import ALL_CORES, NEW_FOLDER, Folder, Work, run_directory

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
    from s2c2a_experiments.randomized_arms import (
        EXPERIMENT,
        TASKS,
        RandomizedArmsStudy,
        randomized_arms_rows,
    )

    study = RandomizedArmsStudy(
        load_arm(base),
        arms,
        strengths,
        strategies,
        tasks or TASKS,
        targets,
        seed,
        reachable_from,
    )
    options = asdict(study) | {"base": base}
    with run_directory(EXPERIMENT, options, work, resume=True) as (directory, make):
        rows = randomized_arms_rows(study, make)
        table = _save_table(EXPERIMENT, rows, directory)
    print_results(EXPERIMENT, _summary_rows(rows), [], directory)
    print(table)


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
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs import checked_seeds
    from s2c2a_experiments import sensors as study
    from s2c2a_experiments.figures.sensors import sensor_comparison_figure

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
        payloads=tuple(payload / 1000 for payload in payloads_g),
        tasks=tasks,
        seeds=tuple(checked_seeds(0, seeds)),
        strength=strength,
        events="; ".join(event),
    )
    with run_directory(study.EXPERIMENT, options, work, resume=True) as (
        directory,
        make,
    ):
        rows = study.sensor_rows(compared, make)
        save_rows(rows, directory / "results.json")
        figures = []
        for name, task in dict.fromkeys((row.arm, row.task) for row in rows):
            if errors := study.errors_by_set(rows, name, task):
                path = directory / f"{name}-{task}.png"
                figures.append(
                    sensor_comparison_figure(errors, path, f"{task} with {name}")
                )
    print_results(f"sensors, {seeds} seeds", rows, figures, directory)


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
        seconds: for which a point is held; at least 20.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs import checked_seeds
    from s2c2a_experiments import stability as study
    from s2c2a_experiments.sensors import randomized_arms

    base = load_arm(arm)
    arms = [base]
    if random_arms:
        for strength in strengths:
            arms += randomized_arms(base, random_arms, strength)
    payloads = tuple(payload / 1000 for payload in payloads_g)
    numbers = tuple(checked_seeds(0, seeds))
    compared = study.StabilityStudy(tuple(arms), sets, payloads, numbers, seconds)
    options = asdict(compared) | {"arms": [one.name for one in arms]}
    with run_directory(study.EXPERIMENT, options, work, resume=True) as (
        directory,
        make,
    ):
        rows = study.stability_rows(compared, make)
        save_rows(rows, directory / "results.json")
    print_results(study.EXPERIMENT, rows, [], directory)
    vibrating = study.vibrating(rows)
    print(f"{len(vibrating)} of {len(rows) // 3} runs vibrate")


@beside("random_arms", "strength")
def repetition(
    arm: Arm = "twin_arm",
    random_arms: int = 3,
    strength: float = 1.0,
    tasks: tuple[str, ...] = ("circle",),
    repetitions: int = 5,
    seeds: int = 1,
    work: Work = ALL_CORES,
) -> None:
    """Iterative learning control with a slow camera, on randomized arms.

    Repeat the command to continue an interrupted run.

    Args:
        arm: a preset or an arm file.
        random_arms: number of randomized arms, sampled as `s2c2a arm random` does, to use
            instead of this arm; none if zero.
        strength: magnitude of their mismatch.
        tasks: names of tasks.
        repetitions: of each task.
        seeds: number of seeds, from zero.
        work: run directory and parallel execution.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs import checked_seeds
    from s2c2a_experiments import repetition as study
    from s2c2a_experiments.sensors import randomized_arms

    arms = randomized_arms(load_arm(arm), random_arms, strength)
    numbers = tuple(checked_seeds(0, seeds))
    repeated = study.RepetitionStudy(arms, tasks, repetitions, numbers)
    options = asdict(repeated) | {"arms": [one.name for one in arms]}
    with run_directory(study.EXPERIMENT, options, work, resume=True) as (
        directory,
        make,
    ):
        rows = study.repetition_rows(repeated, make)
        save_rows(rows, directory / "results.json")
    print_results(study.EXPERIMENT, rows, [], directory)


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
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs import checked_seeds
    from s2c2a_experiments import sensor_faults as study

    numbers = tuple(checked_seeds(0, seeds))
    durations = (*seconds, float("inf"))
    compared = study.SensorFaultStudy(
        load_arm(arm), sets, faults, durations, payload_g / 1000, numbers
    )
    options = asdict(compared) | {"arm": arm}
    with run_directory(study.EXPERIMENT, options, work, resume=True) as (
        directory,
        make,
    ):
        rows = study.sensor_fault_rows(compared, make)
        save_rows(rows, directory / "results.json")
    print_results(study.EXPERIMENT, rows, [], directory)


def transfer(
    arm_seeds: tuple[int, ...] = (0, 20, 21),
    counts: tuple[int, int] = (4, 6),
    halves: tuple[int, ...] = (20, 21),
    strength: float = 0.5,
    tasks: tuple[str, ...] = ("circle", "tilt-50"),
    samples: tuple[int, ...] = (0, 500),
    base: Arm = "twin_arm",
    seed: int = 0,
    prior: int = 24,
    work: Work = ALL_CORES,
) -> None:
    """Transfer of networks to a similar arm or another module count (docs/guides/transfer.md).

    Repeat the command to continue an interrupted run.

    Args:
        arm_seeds: seeds of randomized arms, as `s2c2a arm random` samples them; each starts
            training from the networks of the next.
        counts: module counts of the source and of the target; their modules have half
            the length of the base's.
        halves: seeds of randomized arms with these module counts.
        strength: magnitude of the mismatch.
        tasks: names of tasks.
        samples: lengths of short recordings, such as 0 100 500 2000; 0 for none.
        base: a preset or an arm file.
        seed: random seed of data, training and start.
        prior: number of further randomized arms that a prior is learned from; 0 for no
            prior.
        work: run directory and parallel execution.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a_experiments.transfer import EXPERIMENT, Transfer, transfer_rows

    study = Transfer(
        load_arm(base), arm_seeds, counts, halves, strength, tasks, samples, seed, prior
    )
    options = asdict(study) | {"base": base}
    with run_directory(EXPERIMENT, options, work, resume=True) as (directory, make):
        rows = transfer_rows(study, make)
        save_rows(rows, directory / "results.json")
    print_results(EXPERIMENT, _summary_rows(rows), [], directory)


def real(
    recording: tyro.conf.Positional[Path],
    unseen: tuple[Path, ...] = (),
    block: int = 25,
    last: int = 0,
    largest: float = 0.0,
    models: tuple[str, ...] = (),
    seeds: int = 1,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Forward models on recordings of real arms, such as `s2c2a import` writes.

    Held-out rows are not used in training. Hysteresis states are propagated along the
    whole recording.

    Args:
        recording: training data.
        unseen: other recordings of the same arm, used for testing only.
        block: hold out the 7th, 14th and 20th of every twenty blocks of so many rows;
            none if zero.
        last: hold out so many last rows of every episode, in a separate training; none
            if zero.
        largest: hold out this share of the rows, those with the largest pulls, in a
            separate training, such as 0.15; none if zero.
        models: names of models; all by default.
        seeds: number of training seeds, from zero.
        folder: run directory.
    """
    from s2c2a_experiments.real import EXPERIMENT, RealComparison, real_rows

    study = RealComparison.of(recording, unseen, block, last, models, largest)
    options = {
        "recording": str(recording),
        "unseen": [str(path) for path in unseen],
        "block": block,
        "last": last,
        "largest": largest,
        "models": models,
        "seeds": seeds,
    }
    with (
        run_directory(EXPERIMENT, options, folder) as (directory, _),
        progress_bar() as progress,
    ):
        keep = partial(_save_table, EXPERIMENT, directory=directory)
        rows = real_rows(study, range(seeds), progress, keep)
        table = keep(rows)
    print_results(EXPERIMENT, rows, [], directory)
    print(table)


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
    from s2c2a.evaluation.report import save_rows
    from s2c2a.strategies import load_networks
    from s2c2a_experiments.payloads import EXPERIMENT, payload_rows

    loaded = {str(path.with_suffix("")): load_recording(path) for path in recordings}
    options = {
        "weights": weights,
        "recordings": [str(path) for path in recordings],
        "seen": seen,
    }
    with run_directory(EXPERIMENT, options, folder) as (directory, _):
        keep = partial(save_rows, path=directory / "results.json")
        rows = payload_rows(load_networks(weights), loaded, seen, keep)
    print_results(f"payloads, tip measured for {seen:g} s", rows, [], directory)


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
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs.circle import ARMS
    from s2c2a_experiments.plans import plan_rows

    networks = [strategies.load_networks(path) for path in weights]
    if not networks:
        networks = [strategies.shipped_networks(load_arm(name)) for name in ARMS]
    options = {"weights": weights, "count": count, "seed": seed}
    with run_directory("plans", options, folder) as (directory, _):
        keep = partial(save_rows, path=directory / "results.json")
        rows = plan_rows(networks, count, seed, keep)
    print_results(f"{count} plans compared with a long search", rows, [], directory)


def _summary_rows(rows: list) -> list:
    """Rows of averages over arms."""
    return [row for row in rows if " arms at " in row.arm]


def _save_table(name: str, rows: list, directory: Path) -> str:
    """Save a table and return a message with its path."""
    from s2c2a_experiments.table_files import save_table

    path = save_table(name, rows, directory)
    return f"table: {path} (.csv, .tex, .json next to it)"
