"""The protocol of the benchmark: arms, tasks, seeds and bounds; docs/results/planners.md.

Whoever changes what is run or scored raises `VERSION`: results of different versions are
not comparable.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from typing import Literal

from s2c2a import jobs
from s2c2a.arm import ArmSpec, load_arm, randomized_arm
from s2c2a.goals import GoalPart
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning.reach import Reachability
from s2c2a.robots import RobotFactory
from s2c2a.tasks import Score, Task, load_task
from s2c2a.tasks.projection import projected
from s2c2a_experiments.scenes import drawn_task

VERSION = 2
AGED = 1.0
"""Arms are older than their recordings: no user drives an arm on the day of its data."""
PAYLOAD = 0.2  # of the arm's mass
FITTED = {"opencr_v4": 0.25, "stanford_trunk": 1.0}
"""Arms fitted to recordings, with the pace of their tasks: the first one takes 1.7 steps
a second."""
RANDOMIZED = ((0, 0.5), (1, 0.5), (2, 1.0), (3, 1.0))
"""Seed and strength of the mismatch; nothing is tuned on them."""
HELD_OUT = ((1001, 0.5), (1002, 1.0))
"""The same; reported apart, so that no design decision rests on them."""
TUNED_ON = (100, 0.5)
"""The arm that every entrant is tuned on; it is in no table."""
SCENES = (0, 1, 2)
HELD_OUT_SCENES = (1001, 1002, 1003)
Group = Literal["preset", "randomized", "fitted", "held out", "yours"]
Condition = Literal["", "payload unknown", "payload known"]
ARMS = resources.files("s2c2a_experiments.benchmark").joinpath("arms")


@dataclass(frozen=True)
class BenchmarkArm:
    """An arm of the protocol.

    Attributes:
        arm: with its mismatch, which no entrant knows.
        group: of the results.
        pace: of its tasks, in parts of theirs.
    """

    arm: ArmSpec
    group: Group
    pace: float = 1.0

    @property
    def scenes(self) -> tuple[int, ...]:
        """Seeds of its random scenes."""
        if self.group == "held out":
            return HELD_OUT_SCENES
        return SCENES


@dataclass(frozen=True)
class BenchmarkTask:
    """A task of the protocol.

    Attributes:
        name: of its column.
        needs: parts of goals that an entrant must not ignore.
        goals: makes the tasks of an arm, of which the first `scenes` count.
        condition: of the arm.
        modules: that an arm must have.
        scenes: number of tasks.
    """

    name: str
    needs: frozenset[GoalPart]
    goals: Callable[[BenchmarkArm], list[Task]]
    condition: Condition = ""
    modules: int = 1
    scenes: int = 1

    def tasks(self, arm: BenchmarkArm) -> list[Task]:
        """The tasks of an arm."""
        return self.goals(arm)[: self.scenes]

    def conditions(self, arm: ArmSpec) -> jobs.Conditions:
        """What runs of this task are made under."""
        payload = 0.0
        if self.condition:
            payload = PAYLOAD * arm.mass
        robot = RobotFactory.simulation(aged=AGED, payload=payload)
        return jobs.Conditions(robot, may_end_early=True)


SOURCES = {
    "path": "circle",
    "orientation": "tilt-50",
    "constraint": "hold-middle",
    "moving target": "follow",
}
"""Tasks of the package behind those of the protocol. Their other name keeps weights of
axes, which recipes state by task, out: all entrants have the same goals."""


def _task(name: str, arm: BenchmarkArm) -> list[Task]:
    """The task of this name, on fitted arms and yours within reach of ideal arcs."""
    source = SOURCES[name]
    if arm.pace != 1.0:
        source = f"{source}@{arm.pace:g}"
    task = replace(load_task(source, arm.arm), name=name)
    if name == "orientation":
        # the tilt alone leaves out where the axis points
        task = replace(task, scores=(Score("position"), Score("orientation")))
    if arm.group not in ("fitted", "yours"):
        return [task]
    arcs = Reachability(arm.arm, PCCForwardModel.of(arm.arm), 0.0, "tip")
    return [projected(task, arm.arm.length, arcs).task]


def _scenes(arm: BenchmarkArm) -> list[Task]:
    rate = arm.arm.control_rate / arm.pace
    slower = arm.arm.model_copy(update={"control_rate": rate})
    return [drawn_task(slower, seed) for seed in arm.scenes]


AXES: frozenset[GoalPart] = frozenset({"axes"})
TASKS = {
    task.name: task
    for task in (
        BenchmarkTask("path", frozenset(), partial(_task, "path")),
        BenchmarkTask("orientation", AXES, partial(_task, "orientation")),
        BenchmarkTask(
            "constraint",
            AXES | {"other ends"},
            partial(_task, "constraint"),
            modules=3,
        ),
        BenchmarkTask(
            "obstacles", frozenset({"obstacles"}), _scenes, scenes=len(SCENES)
        ),
        BenchmarkTask("moving target", frozenset(), partial(_task, "moving target")),
        BenchmarkTask(
            "payload", frozenset(), partial(_task, "path"), "payload unknown"
        ),
        BenchmarkTask(
            "known payload", frozenset(), partial(_task, "path"), "payload known"
        ),
    )
}
"""Tasks by name."""


def protocol_arms() -> list[BenchmarkArm]:
    """Two presets, four randomized, two fitted to logs, two held out."""
    simulated = load_arm("simulated_arm").model_copy(update={"sensing": "encoders"})
    presets = [BenchmarkArm(arm, "preset") for arm in (load_arm("twin_arm"), simulated)]
    arms = []
    for name, pace in FITTED.items():
        with resources.as_file(ARMS.joinpath(f"{name}.toml")) as path:
            arms.append(BenchmarkArm(load_arm(str(path)), "fitted", pace))
    return [*presets, *_randomized(RANDOMIZED, "randomized"), *arms, *held_out()]


def held_out() -> list[BenchmarkArm]:
    """Arms on which no design decision rests."""
    return _randomized(HELD_OUT, "held out")


def tuning_arm() -> BenchmarkArm:
    """The arm that every entrant is tuned on."""
    return _randomized((TUNED_ON,), "randomized")[0]


def _randomized(
    mismatches: tuple[tuple[int, float], ...], group: Group
) -> list[BenchmarkArm]:
    base = load_arm("twin_arm")
    return [
        BenchmarkArm(randomized_arm(base, seed, strength), group)
        for seed, strength in mismatches
    ]
