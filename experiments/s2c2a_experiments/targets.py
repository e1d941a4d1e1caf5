"""Targets within and out of the reach of a simulated arm, kept in the cache."""

import hashlib
from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from safetensors import SafetensorError
from safetensors.numpy import load, save

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import interpolated
from s2c2a.errors import S2C2AError
from s2c2a.execution.progress import Progress
from s2c2a.files.text import write_atomically
from s2c2a.goals import Goal
from s2c2a.jobs import Artifact, Cache
from s2c2a.jobs.artifacts import Made, digest_of
from s2c2a.spaces import AXIS, POSITION
from s2c2a.tasks import Task, load_task
from s2c2a_experiments.true_reach import RestingShape, TrueReach

SEARCH_INTERVAL = 5  # steps of a task between searches; goals between are interpolated
TOLERANCE = 0.003  # m; a goal that the arm misses by less is not moved
HOLD_TIME = 5.0  # s for each target
OUTWARD_SHIFT = 0.3  # of the arm's length; from a reachable point to one out of reach
CENTER_HEIGHT = 1 / 3  # of the arm's length; the shift points away from this point

Arrays = dict[str, np.ndarray]


class TargetSequence(NamedTuple):
    """Targets that are held one after the other.

    Attributes:
        task: with the targets as goals.
        distances: smallest distance of the arm's tip to each [m], shape (targets,).
    """

    task: Task
    distances: Float[np.ndarray, " targets"]


@dataclass(frozen=True)
class _TargetSearch(Artifact[Made]):
    """The result of a search over the resting shapes of an arm.

    Attributes:
        arm: with its mismatch.
    """

    kind = "targets"
    arm: ArmSpec

    @abstractmethod
    def search(self, reach: TrueReach, progress: Progress) -> Arrays:
        """Arrays to keep, by name."""

    @abstractmethod
    def read(self, arrays: Arrays) -> Made:
        """The task or targets that these arrays describe."""

    @property
    @abstractmethod
    def key(self) -> tuple:
        """All inputs of the search except the arm."""

    @property
    def file(self) -> str:
        digest = digest_of(type(self), self.arm, *self.key)
        return f"{self.arm.name}-targets-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        arrays = self.search(TrueReach(self.arm), progress)
        # safetensors stores contiguous arrays only
        contiguous = {
            name: np.ascontiguousarray(values) for name, values in arrays.items()
        }
        write_atomically(save(contiguous), self.path(cache))

    def load(self, cache: Cache) -> Made:
        path = self.path(cache)
        try:
            return self.read(load(path.read_bytes()))
        except (OSError, SafetensorError, KeyError, ValueError) as error:
            raise S2C2AError(
                f"{path} holds no targets: {error}; delete it to make them again"
            ) from error


@dataclass(frozen=True)
class ReachableTask(_TargetSearch[Task]):
    """A task of the protocol, with unreachable goals moved to the arm's nearest shape.

    Attributes:
        name: of the task.
    """

    name: str

    @property
    def key(self) -> tuple:
        """See `_TargetSearch`; the file of a path can change under the same name."""
        digest = hashlib.sha256()
        for goal in load_task(self.name, self.arm).goals:
            for values in goal:
                digest.update(np.ascontiguousarray(values).tobytes())
        return self.name, digest.hexdigest()

    def search(self, reach: TrueReach, progress: Progress) -> Arrays:
        """See `_TargetSearch`; displacements of the goals."""
        goals = load_task(self.name, self.arm).goals
        steps = sorted({*range(0, len(goals), SEARCH_INTERVAL), len(goals) - 1})
        shape: RestingShape | None = None
        moves = []
        for count, step in enumerate(steps, 1):
            goal = goals[step]
            shape = reach.nearest(goal, shape)
            desired = np.concatenate([goal.positions, goal.axes], axis=-1)
            reached = desired if shape.error < TOLERANCE else shape.states
            moves.append(reached - desired)
            progress(str(self), count, len(steps))
        columns = np.reshape(moves, (len(steps), -1))
        rows = interpolated(np.arange(len(goals)), np.array(steps), columns)
        return {"moves": rows.reshape(len(goals), *moves[0].shape)}

    def read(self, arrays: Arrays) -> Task:
        task = load_task(self.name, self.arm)
        pairs = zip(task.goals, arrays["moves"], strict=True)
        return replace(task, goals=tuple(_moved(goal, move) for goal, move in pairs))

    def __str__(self) -> str:
        return f"reachable {self.name} of {self.arm.name}"


@dataclass(frozen=True)
class RandomTargets(_TargetSearch[TargetSequence]):
    """Random targets for the tip, each held for `HOLD_TIME`.

    Attributes:
        count: number of targets.
        unreachable_waypoints: whether the arm cannot reach them.
    """

    count: int
    unreachable_waypoints: bool = False

    @property
    def key(self) -> tuple:
        return self.count, self.unreachable_waypoints

    def search(self, reach: TrueReach, progress: Progress) -> Arrays:
        """See `_TargetSearch`; positions and smallest distances [m]."""
        random = np.random.default_rng([self.count, int(self.unreachable_waypoints)])
        actions = reach.random_actions(self.count, random)
        tips = reach.states(actions)[:, -1, POSITION]
        if not self.unreachable_waypoints:
            return {"positions": tips, "distances": np.zeros(self.count)}
        length = self.arm.length
        outward = tips - [0.0, 0.0, CENTER_HEIGHT * length]
        norms = np.linalg.norm(outward, axis=-1, keepdims=True)
        tips = tips + OUTWARD_SHIFT * length * outward / norms
        distances = []
        for done, tip in enumerate(tips, 1):
            distances.append(reach.nearest(self._goal(tip)).error)
            progress(str(self), done, self.count)
        return {"positions": tips, "distances": np.array(distances)}

    def read(self, arrays: Arrays) -> TargetSequence:
        steps = round(HOLD_TIME * self.arm.control_rate)
        goals: list[Goal] = []
        for tip in arrays["positions"]:
            goals += [self._goal(tip)] * steps
        name = "beyond" if self.unreachable_waypoints else "held"
        return TargetSequence(Task(name, tuple(goals)), arrays["distances"])

    def _goal(self, tip: np.ndarray) -> Goal:
        return Goal.of(self.arm.module_count).with_position(tip)

    def __str__(self) -> str:
        where = "out of" if self.unreachable_waypoints else "within"
        return f"{self.count} targets {where} reach of {self.arm.name}"


def _moved(goal: Goal, move: Float[np.ndarray, "modules 6"]) -> Goal:
    """The goal with its desired positions and axes displaced."""
    for module in np.flatnonzero(goal.position_weights):
        position = goal.positions[module] + move[module, POSITION]
        weight = float(goal.position_weights[module])
        goal = goal.with_position(position, weight, int(module))
    for module in np.flatnonzero(goal.axis_weights):
        axis = goal.axes[module] + move[module, AXIS]
        weight = float(goal.axis_weights[module])
        goal = goal.with_axis(axis, weight, int(module))
    return goal
