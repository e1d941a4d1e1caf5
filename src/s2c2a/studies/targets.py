"""Targets that an arm can really reach, or not, found on its simulated body and kept like all that takes time."""

import hashlib
from abc import abstractmethod
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from safetensors import SafetensorError
from safetensors.numpy import load, save

from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.files import save_whole
from s2c2a.goals import Goal
from s2c2a.jobs import Artifact, Cache
from s2c2a.jobs.artifacts import Made, digest_of
from s2c2a.progress import Progress
from s2c2a.spaces import AXIS, POSITION
from s2c2a.studies.true_reach import Reached, TrueReach
from s2c2a.tasks import Task, task_named

# steps of a task from search to search; between them what was moved is moved in
# proportion
EVERY = 5
KEPT = 0.003  # m: a goal that the arm misses by less stays where it is
HOLD = 5.0  # s
# of the arm's length: how far outside of a reachable point a target out of reach is
BEYOND = 0.3
ROOT = 1 / 3  # of the arm's length up: where outside is away from
CASES = (0, 1)  # of the targets' random streams: within reach, out of it


class Held(NamedTuple):
    """Targets that are held, one after the other.

    Attributes:
        task: what is asked.
        distances: how near to each the arm gets [m], shape (targets,).
    """

    task: Task
    distances: Float[np.ndarray, " targets"]


@dataclass(frozen=True)
class _Found(Artifact[Made]):
    """What a search on an arm's body found.

    Attributes:
        arm: with its mismatch.
    """

    kind = "targets"
    arm: ArmSpec

    @abstractmethod
    def search(self, reach: TrueReach, progress: Progress) -> dict[str, np.ndarray]:
        """What is kept, by name."""

    @abstractmethod
    def read(self, found: dict[str, np.ndarray]) -> Made:
        """What is made of it."""

    @property
    @abstractmethod
    def asked(self) -> tuple:
        """All that it depends on beside the arm."""

    @property
    def file(self) -> str:
        """See `Artifact`."""
        return f"{self.arm.name}-targets-{digest_of('targets', arm_to_toml(self.arm), *self.asked)}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        found = self.search(TrueReach(self.arm), progress)
        # the format asks for it
        rows = {name: np.ascontiguousarray(values) for name, values in found.items()}
        save_whole(save(rows), self.path(cache))

    def load(self, cache: Cache) -> Made:
        """See `Artifact`."""
        try:
            return self.read(load(self.path(cache).read_bytes()))
        except (OSError, SafetensorError, KeyError, ValueError) as error:
            raise S2C2AError(
                f"{self.path(cache)} holds no targets: {error}; make them again"
            ) from error


@dataclass(frozen=True)
class ReachableTask(_Found[Task]):
    """A task of the protocol whose goals are put where the arm gets nearest, if it cannot get there.

    Attributes:
        name: of the task.
    """

    name: str

    @property
    def asked(self) -> tuple:
        """See `_Found`; waypoints can change under one name."""
        parts = (
            np.ascontiguousarray(part).tobytes()
            for goal in task_named(self.name, self.arm).goals
            for part in goal
        )
        return self.name, hashlib.sha256(b"".join(parts)).hexdigest()

    def search(self, reach: TrueReach, progress: Progress) -> dict[str, np.ndarray]:
        """See `_Found`: what goals are moved by."""
        goals = task_named(self.name, self.arm).goals
        steps = sorted({*range(0, len(goals), EVERY), len(goals) - 1})
        near: Reached | None = None
        moves = []
        for count, step in enumerate(steps, 1):
            near = reach.nearest(goals[step], near)
            asked = np.concatenate([goals[step].positions, goals[step].axes], axis=-1)
            moves.append(
                np.zeros_like(asked) if near.miss < KEPT else near.states - asked
            )
            progress(str(self), count, len(steps))
        return {"moves": _between(np.array(steps), np.array(moves), len(goals))}

    def read(self, found: dict[str, np.ndarray]) -> Task:
        """See `_Found`."""
        described = task_named(self.name, self.arm)
        goals = (
            _moved(*both) for both in zip(described.goals, found["moves"], strict=True)
        )
        return replace(described, goals=tuple(goals))

    def __str__(self) -> str:
        return f"reachable {self.name} of {self.arm.name}"


@dataclass(frozen=True)
class HeldTargets(_Found[Held]):
    """Random targets for the tip, one after the other, each held for some seconds.

    Attributes:
        count: how many.
        beyond: whether they are out of reach.
    """

    count: int
    beyond: bool = False

    @property
    def asked(self) -> tuple:
        """See `_Found`."""
        return self.count, self.beyond

    def search(self, reach: TrueReach, progress: Progress) -> dict[str, np.ndarray]:
        """See `_Found`: where they are [m], and how near the arm gets [m]."""
        random = np.random.default_rng([self.count, CASES[self.beyond]])
        tips = reach.states(reach.random_shares(self.count, random))[:, -1, POSITION]
        if not self.beyond:
            return {"positions": tips, "distances": np.zeros(self.count)}
        outward = tips - [0.0, 0.0, ROOT * self.arm.length]
        tips = tips + BEYOND * self.arm.length * outward / np.linalg.norm(
            outward, axis=-1, keepdims=True
        )
        distances = []
        for done, tip in enumerate(tips, 1):
            distances.append(reach.nearest(self._goal(tip)).miss)
            progress(str(self), done, self.count)
        return {"positions": tips, "distances": np.array(distances)}

    def read(self, found: dict[str, np.ndarray]) -> Held:
        """See `_Found`."""
        steps = round(HOLD * self.arm.control_rate)
        goals = chain.from_iterable(
            [self._goal(tip)] * steps for tip in found["positions"]
        )
        return Held(
            Task("beyond" if self.beyond else "held", tuple(goals)), found["distances"]
        )

    def _goal(self, tip: np.ndarray) -> Goal:
        return Goal.of(self.arm.module_count).with_position(tip)

    def __str__(self) -> str:
        return f"{self.count} targets {'out of' if self.beyond else 'within'} reach of {self.arm.name}"


def _between(
    steps: np.ndarray, moves: np.ndarray, count: int
) -> Float[np.ndarray, "goals modules 6"]:
    """Moves of all goals from those of some."""
    flat = moves.reshape(len(steps), -1)
    every = np.array(
        [np.interp(np.arange(count), steps, column) for column in flat.T]
    ).T
    return every.reshape(count, *moves.shape[1:])


def _moved(goal: Goal, move: Float[np.ndarray, "modules 6"]) -> Goal:
    """What is asked of a goal, elsewhere; what is not stays."""
    for module in np.flatnonzero(goal.position_weights):
        place = goal.positions[module] + move[module, POSITION]
        weight = float(goal.position_weights[module])
        goal = goal.with_position(place, weight, int(module))
    for module in np.flatnonzero(goal.axis_weights):
        axis = goal.axes[module] + move[module, AXIS]
        weight = float(goal.axis_weights[module])
        goal = goal.with_axis(axis, weight, int(module))
    return goal
