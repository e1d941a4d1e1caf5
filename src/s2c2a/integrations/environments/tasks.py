"""Families of tasks: goals, disturbances, observation, reward, end and randomization.

The reward of a step is, with the distance d of the tip from its goal, the length L of
the arm, and the k components a_i of the action,

    r = -10 d / L - 0.1 (a_1^2 + ... + a_k^2) / k

and in `Avoid` also -100 p / L, where p is how deep the arm's body is inside the sphere.
None of these terminates an episode but a simulation that diverges; a time limit truncates.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import body_radii, center_line, per_module
from s2c2a.arm.randomized import randomized_arm
from s2c2a.errors import S2C2AError, nearest_name
from s2c2a.integrations.environments.spaces import BatchMoment, Controls, observe
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.spaces import CENTER_LINE_POINTS, POSITION

Random = np.random.Generator

DISTANCE_WEIGHT = 10.0  # of the distance in arm lengths; a reach begins near -10
ACTION_WEIGHT = 0.1  # chosen: full speed costs as much as a distance of 1 % of the arm
DEPTH_WEIGHT = 100.0  # ten times the distance's, so that no way leads through a sphere
REACH_SHARE = 0.8  # of the full bends; twin_arm reaches 100 of 100 within 3.6 cm
EPISODE_TIME = 20.0  # s; a run of the package's circle
GOAL_TIME = 4.0  # s for each goal of `Reach`; the approach of the package's circle
FOLLOW_TIME = 2.0  # s between turns of the goal of `Follow`
STAY_SHARE = 0.3  # of the times in which the goal of `Follow` stays
PERIODS = (8.0, 16.0)  # s of a path of `Track`; the package's circle takes 16 s
FORCE_TIME = 2.0  # s that a force of `Hold` lasts
FORCE_SHARE = (
    0.5  # of EI / L^2; moves the tip of a uniform rod by a sixth of its length
)
OBSTACLE_SHARE = 0.08  # of the arm's length, radius of the sphere

METHODS = ("observe", "rewards", "ends", "goals", "scenario", "sampled_arm")
"""Methods of a family by which tasks differ."""

_states = jax.jit(states_from_bends)


@dataclass(frozen=True)
class Scenario:
    """What happens in one episode.

    Attributes:
        goals: of the tip after every step [m], base frame; the first two are that at
            rest and that of the first step, shape (steps + 2, 3).
        forces: at the tip in every step [N], base frame, shape (steps, 3).
        obstacle: center and radius of a sphere [m], base frame, shape (4,); radius 0 for
            none.
    """

    goals: Float[np.ndarray, "moments 3"]
    forces: Float[np.ndarray, "steps 3"]
    obstacle: Float[np.ndarray, "4"]


@dataclass(frozen=True)
class Family(ABC):
    """A family of tasks of one arm: a subclass gives the goals, and what else differs.

    Episodes sample goals, scenario and arm one by one, so that each has a seed of its own;
    observation, reward and end are functions of the whole batch.

    Attributes:
        controls: of the arm.
        steps: control steps of an episode.
        randomization: strength of the model mismatch, 0 to 2.
    """

    controls: Controls
    steps: int
    randomization: float = 0.0

    def __init_subclass__(cls) -> None:
        """Refuse a misspelled method, in whose place that of the base would be used.

        Raises:
            S2C2AError: the name of a public method is nearly one of `METHODS` that the
                class does not have.
        """
        super().__init_subclass__()
        others = [name for name in METHODS if name not in vars(cls)]
        for name, value in vars(cls).items():
            is_own = callable(value) and not hasattr(super(cls, cls), name)
            nearest = nearest_name(name, others)
            if is_own and nearest and not name.startswith("_"):
                raise S2C2AError(
                    f"the task {cls.__name__} states '{name}' (did you mean "
                    f"{nearest}?); tasks differ by {', '.join(METHODS)}: rename it, or "
                    "begin the name of a helper with an underscore"
                )

    @property
    def arm(self) -> ArmSpec:
        """The arm."""
        return self.controls.arm

    def scenario(self, random: Random, tip: Float[np.ndarray, "3"]) -> Scenario:
        """Sample an episode that begins with the tip here [m], base frame."""
        goals = self.goals(random, tip)
        return Scenario(goals, np.zeros((self.steps, 3)), np.zeros(4))

    @abstractmethod
    def goals(
        self, random: Random, tip: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "moments 3"]:
        """Sample the goals of an episode (`Scenario`)."""

    def sampled_arm(self, seed: int) -> ArmSpec:
        """Sample the arm of an episode, unless `randomization` is 0.

        Its cables and modules are those of the arm; their numbers may differ.
        """
        return randomized_arm(self.arm, seed, self.randomization)

    def observe(
        self, moment: BatchMoment
    ) -> Mapping[str, Float[np.ndarray, "batch values"]]:
        """Parts of the observations, which are joined in this order."""
        return observe(self.controls, moment)

    def rewards(self, moment: BatchMoment) -> Float[np.ndarray, " batch"]:
        """Rewards of the step that led to a moment; see the formula of this module."""
        distances = np.linalg.norm(moment.tips - moment.goals, axis=-1)
        effort = np.mean(moment.actions**2, axis=-1)
        return -DISTANCE_WEIGHT * distances / self.arm.length - ACTION_WEIGHT * effort

    def ends(self, moment: BatchMoment) -> Bool[np.ndarray, " batch"]:
        """Which episodes terminate at a moment, before their time is over."""
        return np.zeros(len(moment.steps), bool)

    def count_of(self, seconds: float) -> int:
        """Control steps in a time, at least one."""
        return max(1, round(seconds * self.arm.control_rate))

    def sample_bends(
        self, random: Random, count: int
    ) -> Float[np.ndarray, "count modules 2"]:
        """Sample bends that the arm can command [rad], evenly in the disk of each module."""
        shares = random.uniform(-1.0, 1.0, (count, self.controls.count))
        bends = np.einsum("kmi,ck->cmi", self.controls.basis, shares)
        sizes = np.linalg.norm(bends, axis=-1, keepdims=True)
        largest = REACH_SHARE * self.controls.geometry.bend_limits[:, None]
        return largest * bends / np.maximum(sizes, 1.0)

    def tips(
        self, bends: Float[np.ndarray, "count modules 2"]
    ) -> Float[np.ndarray, "count 3"]:
        """Tip positions of bends by arcs of constant curvature [m], base frame."""
        lengths = self.controls.geometry.lengths.astype(np.float32)
        states = np.asarray(_states(bends.astype(np.float32), lengths), float)
        return states[:, -1, POSITION]


class Reach(Family):
    """Reach points and stay there; a new one every 4 s, without notice."""

    def goals(self, random, tip):
        held = self.count_of(GOAL_TIME)
        count = -(-(self.steps + 1) // held)
        points = self.tips(self.sample_bends(random, count))
        repeated = np.repeat(points, held, axis=0)
        return np.vstack([tip, repeated[: self.steps + 1]])


class Follow(Family):
    """Follow a goal that moves, turns and pauses without notice, every 2 s."""

    def goals(self, random, tip):
        held = self.count_of(FOLLOW_TIME)
        count = -(-(self.steps + 1) // held) + 1
        corners = self.sample_bends(random, count)
        corners[0] = 0.0
        for number in np.flatnonzero(random.random(count - 1) < STAY_SHARE):
            corners[number + 1] = corners[number]
        moments = np.arange(self.steps + 2) / held
        start = np.minimum(moments.astype(int), count - 2)
        shares = (moments - start)[:, None, None]
        begin = corners[start]
        end = corners[start + 1]
        return self.tips(begin * (1.0 - shares) + end * shares)


class Track(Family):
    """Track a closed path: every bend is an offset and a sine of one random period."""

    def goals(self, random, tip):
        offset, first, second = 0.5 * self.sample_bends(random, 3)
        period = random.uniform(*PERIODS)
        times = np.arange(self.steps + 2) / self.arm.control_rate
        phases = (2.0 * np.pi * times / period)[:, None, None]
        turning = np.sin(phases) * first + np.cos(phases) * second
        start = np.minimum(times / GOAL_TIME, 1.0)[:, None, None]
        return self.tips(start * (offset + np.sqrt(0.5) * turning))


class Hold(Family):
    """Hold the tip where it is at rest, while forces of 2 s push it."""

    def goals(self, random, tip):
        return np.tile(tip, (self.steps + 2, 1))

    def scenario(self, random, tip):
        held = self.count_of(FORCE_TIME)
        count = -(-self.steps // held)
        stiffness = per_module(self.arm, "bending_stiffness").mean()
        largest = FORCE_SHARE * stiffness / self.arm.length**2  # N
        directions = random.normal(size=(count, 3))
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        sizes = random.uniform(0.0, largest, (count, 1))
        forces = np.repeat(sizes * directions, held, axis=0)[: self.steps]
        return Scenario(self.goals(random, tip), forces, np.zeros(4))


class Avoid(Reach):
    """Reach points around a sphere, which no part of the arm may enter."""

    def scenario(self, random, tip):
        found = super().scenario(random, tip)
        radius = OBSTACLE_SHARE * self.arm.length
        goals = found.goals[1:]
        # between the first two goals, where both can be reached without touching it
        steps = np.abs(np.diff(goals, axis=0)).max(axis=-1)
        changes = np.flatnonzero(steps > 0)
        second = goals[changes[0] + 1] if len(changes) else tip
        center = (goals[0] + second) / 2
        # the center is as far from both
        gap = np.linalg.norm(center - second)
        radius = min(radius, 0.5 * float(gap))
        return Scenario(found.goals, found.forces, np.array([*center, radius]))

    def observe(self, moment):
        centers = moment.obstacles[:, :3]
        radii = moment.obstacles[:, 3:]
        sphere = np.concatenate([centers - moment.tips, radii], axis=-1)
        return {**super().observe(moment), "obstacle": sphere / self.arm.length}

    def rewards(self, moment):
        depths = self.depths(moment)
        return super().rewards(moment) - DEPTH_WEIGHT * depths / self.arm.length

    def depths(self, moment: BatchMoment) -> Float[np.ndarray, " batch"]:
        """How deep the arm's body is in the sphere [m]; zero outside."""
        geometry = self.controls.geometry
        points = center_line(moment.states, geometry.lengths)
        body = body_radii(
            geometry.lengths.tolist(),
            [module.radius for module in self.arm.modules],
            CENTER_LINE_POINTS,
        )
        centers = moment.obstacles[:, None, :3]
        radii = moment.obstacles[:, 3:]
        distances = np.linalg.norm(points - centers, axis=-1)
        return np.maximum(radii + body - distances, 0.0).max(axis=-1)


FAMILIES: dict[str, type[Family]] = {
    family.__name__: family for family in (Reach, Track, Avoid, Hold, Follow)
}
"""Families of tasks by name."""
