"""`s2c2a reproduce`, beyond the paper's tables: randomized arms, sensors, transfer, real recordings, plans."""

from dataclasses import asdict
from pathlib import Path
from typing import Literal

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, print_results, progress_bar
from s2c2a.cli.execution import ALL_CORES, NEW_FOLDER, Folder, Work, making

Compared = Literal["best", "best-long", "paper", "pcc", "pcc-fitted"]
TILT_TASKS = ("tilt-40", "tilt-50", "tilt-60", "tilt-0", "tilt-50-a20", "tilt-50-c20")


def randomized_arms(
    arms: int = 10,
    strengths: tuple[float, ...] = (0.5, 1.0),
    strategies: tuple[Compared, ...] = ("best", "paper", "pcc", "pcc-fitted"),
    tasks: tuple[str, ...] = ("circle", *TILT_TASKS, "hold-middle"),
    targets: int = 200,
    base: Arm = "twin_arm",
    seed: int = 0,
    work: Work = ALL_CORES,
) -> None:
    """Arms that nobody modeled: drawn ones through data, training and tasks, for every strategy (docs/protocol.md).

    From strength 0.75 on, targets are put within the reach of the randomized arm. Cut short,
    it goes on where it was.

    Args:
        arms: how many are drawn at each strength, as `s2c2a arm random` does with seeds
            from zero.
        strengths: of their mismatch.
        strategies: best, best-long and paper are recipes of the paper's strategy.
        tasks: by name.
        targets: within reach, each held for five seconds, to see whether any strategy
            runs away; none if zero.
        base: a preset or an arm file: modules, cables, and all that controllers are
            told.
        seed: of data, training and start.
        work: where results go, and who works.
    """
    from s2c2a.evaluation.report import save_table
    from s2c2a.studies.randomized_arms import EXPERIMENT, Unknown, randomized_arms_rows

    asked = Unknown(load_arm(base), arms, strengths, strategies, tasks, targets, seed)
    with making(EXPERIMENT, asdict(asked) | {"base": base}, work, go_on=True) as (
        place,
        make,
    ):
        rows = randomized_arms_rows(asked, make)
        written = save_table(EXPERIMENT, rows, place)
    print_results(
        EXPERIMENT, [row for row in rows if " arms at " in row.arm], [], place
    )
    print(f"table: {written} (.csv, .tex, .json beside it)")


def sensors(
    arm: Arm = "twin_arm",
    drawn: int = 0,
    strength: float = 0.5,
    sets: tuple[str, ...] = (
        "encoders",
        "encoders-told",
        "bends",
        "imu",
        "current",
        "camera",
        "flex",
        "imu-current-camera",
    ),
    loads_g: tuple[float, ...] = (0.0, 50.0, 100.0),
    tasks: tuple[str, ...] = ("circle",),
    seeds: int = 1,
    happens: str = "",
    work: Work = ALL_CORES,
) -> None:
    """What sensors beside encoders are worth under loads that nobody told of, and the margins of each loop.

    Networks are trained without load, once for all sets but `flex`, whose strips are
    learned too. Cut short, it goes on where it was (docs/sensors.md).

    Args:
        arm: a preset or an arm file.
        drawn: how many arms are drawn beside it, as `s2c2a arm random` does, and tried
            in its place; none if zero.
        strength: of their mismatch.
        sets: of sensors; encoders-told is encoders and the word how much hangs at the
            tip.
        loads_g: that hang at the tip [g].
        tasks: by name.
        seeds: how many, from zero.
        happens: while the arm works, such as "6 load 0.05; 10 blind" (docs/sensors.md).
        work: where results go, and who works.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs import checked_seeds
    from s2c2a.studies import sensors as studied
    from s2c2a.viz.sensor_comparison import worth_figure

    numbers = checked_seeds(0, seeds)
    arms = studied.arms_of(load_arm(arm), drawn, strength)
    loads = tuple(load / 1000 for load in loads_g)
    asked = studied.Worth(arms, sets, loads, tasks, tuple(numbers), strength, happens)
    options = {
        "arm": arm,
        "drawn": drawn,
        "strength": strength,
        "sets": sets,
        "loads_g": loads_g,
        "tasks": tasks,
    }
    options |= {"happens": happens, "seeds": seeds}
    with making(studied.EXPERIMENT, options, work, go_on=True) as (place, make):
        rows = studied.sensors_rows(asked, make) + studied.margin_rows(asked, make)
        save_rows(rows, place / "results.json")
        figures = [
            worth_figure(errors, place / f"{named}-{task}.png", f"{task} with {named}")
            for named, task in dict.fromkeys((row.arm, row.task) for row in rows)
            if (errors := studied.errors_of(rows, named, task))
        ]
    print_results(f"sensors, {seeds} seeds", rows, figures, place)


def transfer(
    drawn: tuple[int, ...] = (0, 20, 21),
    counts: tuple[int, int] = (4, 6),
    halves: tuple[int, ...] = (20, 21),
    strength: float = 0.5,
    tasks: tuple[str, ...] = ("circle", "tilt-50"),
    samples: int = 500,
    base: Arm = "twin_arm",
    seed: int = 0,
    work: Work = ALL_CORES,
) -> None:
    """Networks of one arm for another of the same make, and for other module counts (docs/transfer.md).

    Cut short, it goes on where it was.

    Args:
        drawn: seeds of arms as `s2c2a arm random` draws them; each begins from the
            networks of the next.
        counts: of modules, learned from and begun; modules of half the base's length.
        halves: seeds of arms of these counts.
        strength: of their mismatch.
        tasks: by name.
        samples: of a short recording.
        base: a preset or an arm file.
        seed: of data, training and start.
        work: where results go, and who works.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a.studies import transfer as studied

    asked = studied.Transfer(
        load_arm(base), drawn, counts, halves, strength, tasks, samples, seed
    )
    with making(
        studied.EXPERIMENT, asdict(asked) | {"base": base}, work, go_on=True
    ) as (place, make):
        rows = studied.transfer_rows(asked, make)
        save_rows(rows, place / "results.json")
    print_results(
        studied.EXPERIMENT, [row for row in rows if " arms at " in row.arm], [], place
    )


def real(
    recording: tyro.conf.Positional[Path],
    unseen: tuple[Path, ...] = (),
    block: int = 25,
    last: int = 0,
    models: tuple[str, ...] = (),
    seeds: int = 1,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Forward models on a recording of an arm that nobody here made, such as `s2c2a import` writes.

    Rows that are held out are never shown to a model; what cables remember is carried
    along the whole recording.

    Args:
        recording: to learn from.
        unseen: other recordings of the same arm, tried as a whole.
        block: hold out the 7th, 14th and 20th of every twenty blocks of so many rows;
            none if zero.
        last: hold out so many last rows, in a training of their own; none if zero.
        models: by name; all if not stated.
        seeds: of training, from zero.
        folder: where results go.
    """
    from s2c2a.evaluation.report import save_table
    from s2c2a.studies.real import EXPERIMENT, Asked, real_rows

    asked = Asked.of(recording, unseen, block, last, models)
    options = {
        "recording": str(recording),
        "unseen": [str(one) for one in unseen],
        "block": block,
        "last": last,
    }
    with (
        making(EXPERIMENT, options | {"models": models, "seeds": seeds}, folder) as (
            place,
            _,
        ),
        progress_bar() as told,
    ):
        rows = real_rows(asked, range(seeds), told)
        written = save_table(EXPERIMENT, rows, place)
    print_results(EXPERIMENT, rows, [], place)
    print(f"table: {written} (.csv, .tex, .json beside it)")


def loads(
    weights: tyro.conf.Positional[Path],
    recordings: tyro.conf.Positional[tuple[Path, ...]],
    seen: float = 20.0,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Loads in recordings of an arm that nobody here made, of which its networks know nothing.

    The observer hears encoders, and where the tip was for the first seconds; then it
    must do with what it found.

    Args:
        weights: made by `s2c2a train` from a recording without load.
        recordings: of the same arm with something at its tip, imported --like the
            first.
        seen: for how long the tip is seen [s].
        folder: where results go.
    """
    from s2c2a.data import load_recording
    from s2c2a.evaluation.report import save_rows
    from s2c2a.strategies import load_strategy
    from s2c2a.studies.payloads import EXPERIMENT, load_rows

    given = {str(path.with_suffix("")): load_recording(path) for path in recordings}
    options = {
        "weights": weights,
        "recordings": [str(path) for path in recordings],
        "camera_positions": seen,
    }
    with making(EXPERIMENT, options, folder) as (place, _):
        rows = list(load_rows(load_strategy(weights), given, seen))
        save_rows(rows, place / "results.json")
    print_results(f"loads, the tip seen for {seen:g} s", rows, [], place)


def plans(
    weights: tuple[Path, ...] = (),
    count: int = 10_000,
    seed: int = 0,
    folder: Folder = NEW_FOLDER,
) -> None:
    """Drawn plans beside a long search: which of them stand although their cost could fall.

    Args:
        weights: files of networks; those that come with the package if none is given.
        count: of plans for each.
        seed: of all that is drawn.
        folder: where results go.
    """
    from s2c2a import strategies
    from s2c2a.evaluation.report import save_rows
    from s2c2a.studies.circle import ARMS
    from s2c2a.studies.plans import plan_rows

    given = [strategies.load_strategy(path) for path in weights]
    every = given or [strategies.shipped_networks(load_arm(name)) for name in ARMS]
    with making(
        "plans", {"weights": weights, "count": count, "seed": seed}, folder
    ) as (place, _):
        rows = plan_rows(every, count, seed)
        save_rows(rows, place / "results.json")
    print_results(f"{count} drawn plans beside a long search", rows, [], place)
