"""What sensors are worth: sets of them beside encoders, under loads that nobody told of, on given and randomized arms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec, randomized_arm
from s2c2a.arm.sensors import Camera, Flex, Inertial, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.estimation import margins_of
from s2c2a.evaluation import Row, position_errors
from s2c2a.robots import Body
from s2c2a.robots.simulation.events import parse_events
from s2c2a.spaces import POSITION
from s2c2a.strategies import Watched, observer_of, recipe_named
from s2c2a.studies.randomized_arms import over_arms

EXPERIMENT = "sensors"
CURRENT = {"current_noise": 0.15, "current_friction": 0.2}
"""Of a motor such as the XL330 on a pulley of 10 mm [N]."""
SETS: dict[str, dict] = {
    "encoders": {},
    "bends": {"bends": True},
    "imu": {"imu": Inertial()},
    "current": {},
    "camera": {"camera": Camera()},
    "flex": {"flex": Flex()},
    "motion-capture": {"camera": Camera(rate=10.0, delay=0.02, lost=0.0, sees="ends")},
    "imu-current-camera": {"imu": Inertial(), "camera": Camera()},
}
"""Name -> what is sensed beside encoders; `current` in a name is motors' currents."""
TOLD = "encoders-told"
"""Encoders, and the word how much hangs at the tip."""
SETTLED = 20  # steps after which the tip's way counts
STANDS = 0.01  # m; a target that goes no further
LATE = 0.75  # of a run: what comes after is told by itself


@dataclass(frozen=True)
class Worth:
    """What is tried.

    Attributes:
        arms: that sense.
        sets: names of `SETS`, or `TOLD`.
        loads: [kg].
        tasks: names.
        seeds: of data, training and start.
        strength: of randomized arms' mismatch, for the rows.
        happens: while the arm works (`robots.simulation.events`).
    """

    arms: tuple[ArmSpec, ...]
    sets: tuple[str, ...]
    loads: tuple[float, ...]
    tasks: tuple[str, ...]
    seeds: tuple[int, ...]
    strength: float = 0.0
    happens: str = ""

    def __post_init__(self):
        """Refuse what cannot be tried."""
        parse_events(self.happens)
        if unknown := set(self.sets) - {*SETS, TOLD}:
            raise S2C2AError(
                f"no set of sensors '{min(unknown)}'; choose among {', '.join((*SETS, TOLD))}"
            )
        if not (self.arms and self.sets and self.loads and self.tasks and self.seeds):
            raise S2C2AError(
                "nothing to try; name at least one arm, set, load, task and seed"
            )


def arms_of(base: ArmSpec, drawn: int, strength: float) -> tuple[ArmSpec, ...]:
    """A given arm, or so many drawn ones."""
    return tuple(randomized_arm(base, seed, strength) for seed in range(drawn)) or (
        base,
    )


def sensing(arm: ArmSpec, name: str) -> ArmSpec:
    """An arm with a set of sensors."""
    motor = arm.motor.model_copy(
        update=CURRENT if "current" in name else {"current_noise": None}
    )
    return arm.model_copy(
        update={"sensors": Sensors(**SETS.get(name, {})), "motor": motor}
    )


def sensors_rows(asked: Worth, make: jobs.Make) -> list[Row]:
    """Rows of every arm, set, load and task, and margins of every loop.

    Args:
        asked: what is tried.
        make: finds or makes runs, networks and recordings.
    """
    tried = [
        (arm, name, load)
        for arm in asked.arms
        for name in asked.sets
        for load in asked.loads
    ]
    every = jobs.in_groups(make, [_jobs(asked, *one) for one in tried])
    found = {
        one: _rows(runs, _said(asked, *one[1:]))
        for one, runs in zip(tried, every, strict=True)
    }
    rows = [row for ofone in found.values() for row in ofone]
    if len(asked.arms) == 1:
        return rows
    by_arm = [
        [row for one, ofone in found.items() if one[0] is arm for row in ofone]
        for arm in asked.arms
    ]
    return over_arms(by_arm, asked.strength) + rows


def margin_rows(asked: Worth, make: jobs.Make) -> list[Row]:
    """Margins of every loop, with networks of the first seed."""
    recipe = recipe_named("best")
    rows = []
    for arm in asked.arms:
        for name in asked.sets:
            if name in (TOLD, "encoders"):
                continue
            sensed = sensing(arm, name)
            networks = make(
                [
                    jobs.NetworksArtifact(
                        recipe.learned_on(sensed), recipe, asked.seeds[0]
                    )
                ]
            )[0]
            margins = margins_of(sensed, observer_of(replace(networks, arm=sensed)))
            for metric, value, unit in (
                ("gain", margins.gain, "times"),
                ("delay", margins.delay, "steps"),
            ):
                where = "response", "margins", arm.name, "fast", name, recipe.name
                rows.append(
                    Row(*where, metric, unit, float(value), seeds=asked.seeds[:1])
                )
    return rows


def errors_of(rows: Sequence[Row], arm: str, task: str) -> dict[str, dict[str, float]]:
    """Errors of the tip [cm], by set of sensors and by what hangs there and happens."""
    errors: dict[str, dict[str, float]] = {}
    for row in rows:
        if (row.experiment, row.arm, row.task, row.metric) == (
            EXPERIMENT,
            arm,
            task,
            "position",
        ):
            name, under = row.strategy.split(", ", 1)
            errors.setdefault(name, {})[under] = row.mean
    return errors


def _jobs(asked: Worth, arm: ArmSpec, name: str, load: float) -> list[jobs.Job]:
    watched = Watched(load if name == TOLD else 0.0)
    under = jobs.Conditions(
        Body.simulation(payload=load, happens=asked.happens), watched=watched
    )
    return jobs.jobs_for(
        asked.tasks,
        sensing(arm, name),
        ["s2c2a"],
        asked.seeds,
        recipe_named("best"),
        under,
    )


def _said(asked: Worth, name: str, load: float) -> str:
    """In place of the strategy's name."""
    return ", ".join(
        [name, f"{1000 * load:g} g", *[asked.happens] * bool(asked.happens)]
    )


def _rows(runs: Sequence[jobs.Run], said: str) -> list[Row]:
    """Scores, how much further than its target the tip went, and both of the end alone."""
    rows = jobs.score_rows(EXPERIMENT, runs)
    for task in dict.fromkeys(run.task for run in runs):
        ours = [run for run in runs if run.task == task]
        heading = jobs.Heading.of(EXPERIMENT, ours)
        late = [int(LATE * _steps(run)) for run in ours]
        found = {
            ("way", "times"): [_way(run, SETTLED) for run in ours],
            ("way, last quarter", "times"): [
                _way(run, first) for run, first in zip(ours, late, strict=True)
            ],
            ("position, last quarter", "cm"): [
                _off(run, first) for run, first in zip(ours, late, strict=True)
            ],
        }
        told = {
            metric: values
            for metric, values in found.items()
            if np.isfinite(values).all()
        }
        rows += [
            heading.row(task, "s2c2a", *metric, values, [])
            for metric, values in told.items()
        ]
    return [
        replace(row, strategy=said, paper_mean=None, paper_std=None) for row in rows
    ]


def _steps(run: jobs.Run) -> int:
    return len(run.job.task.desired_positions())


def _off(run: jobs.Run, first: int) -> float:
    """Of the tip from its target, from a step on [cm]; NaN where it has none."""
    errors = position_errors(
        run.episode.after("states"), run.job.task.desired_positions()
    )[first:]
    return (
        float(errors[np.isfinite(errors)].mean())
        if np.isfinite(errors).any()
        else np.nan
    )


def _way(run: jobs.Run, first: int) -> float:
    """Of the tip, over that of its target, from a step on; NaN where that stands."""
    desired = run.job.task.desired_positions()[:, -1]
    tip = run.episode.after("states")[: len(desired), -1, POSITION]
    ways = [
        np.linalg.norm(np.diff(path[first:], axis=0), axis=-1)
        for path in (tip, desired)
    ]
    return (
        float(np.nansum(ways[0]) / np.nansum(ways[1]))
        if np.nansum(ways[1]) > STANDS
        else np.nan
    )
