"""What an arm really reaches, searched on its own simulated body at rest, mismatch and age and all (docs/protocol.md).

What depends on the past is left out: the arm is taken as one that follows its motors at
once. In its place the motors' range is made smaller by as much as backlash, friction and
homing can take of it.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout

from s2c2a.arm import ArmGeometry, ArmSpec, Module
from s2c2a.arm.geometry import per_cable, per_module
from s2c2a.goals import Goal
from s2c2a.robots.simulation import FIDELITIES
from s2c2a.robots.simulation.chain import build_model
from s2c2a.spaces import AXIS, POSITION, States

Shares = Float[np.ndarray, "*batch modules 2"]

# s, near to critical
DAMPING_TIME = 0.3
TIME_STEP = 0.02
# from straight to rest, and from one shape to a near one
STEPS = 300
STEPS_NEARBY = 80
AT_ONCE = 64  # arms that settle in one call
HOMING = 2.0  # standard deviations
# of a search: most iterations, finite differences, least gain [m]
TRIES = 12
PROBE = 0.02
ENOUGH = 2e-5
# steps tried: damped, and random ones
DAMPINGS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
LUCK = (0.01, 0.02, 0.03, 0.05, 0.1)
# actions that are known, and how many of them a search begins from
SAMPLES = 512
STARTS = 3
_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS
AXIS_LENGTH = 0.1  # of the arm: what an error of one radian counts for


@dataclass(frozen=True)
class Reached:
    """How near the arm gets to a goal.

    Attributes:
        shares: of the range of its actions, shape (modules, 2).
        states: there, shape (modules, 6).
        physics: of the simulation there.
        miss: length of what is missing, with axes counted by `AXIS_LENGTH` [m].
    """

    shares: Shares
    states: States
    physics: np.ndarray
    miss: float


class TrueReach:
    """Searches an arm's resting shapes.

    Args:
        arm: with its mismatch.
        seed: of the actions that searches begin from.
        aged: how far the arm has drifted.
    """

    def __init__(self, arm: ArmSpec, seed: int = 0, aged: float = 1.0):
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._seed = seed
        self._kept = 1.0 - aged * per_module(arm, "mismatch.drift")[:, None]
        self.most = usable_shares(arm)
        self._model = build_model(_without_memory(arm), FIDELITIES["fast"])
        self._model.opt.timestep = TIME_STEP
        self._data = mujoco.MjData(self._model)
        self._rollout = Rollout(nthread=0)
        self._ends = [
            self._model.site(f"end_{module}").id for module in range(arm.module_count)
        ]

    def states(self, shares: Shares) -> States:
        """Where the arm rests, shape (batch, modules, 6).

        Args:
            shares: of the range of its actions, shape (batch, modules, 2).
        """
        return self._settled(shares)[0]

    def random_shares(self, count: int, random: np.random.Generator) -> Shares:
        """So many within what surely arrives, evenly in the disc of every module."""
        turns, sizes = random.uniform(0, 2 * np.pi, (2, count, len(self.most)))
        sizes = self.most * np.sqrt(sizes / (2 * np.pi))
        return np.stack([sizes * np.cos(turns), sizes * np.sin(turns)], axis=-1)

    def nearest(self, goal: Goal, near: Reached | None = None) -> Reached:
        """The resting shape nearest to a goal, as far as a local search finds it.

        Args:
            goal: one; its obstacles do not count.
            near: begin here too, such as at the shape for the goal before.
        """
        known = sorted((self._missed(one, goal) for one in self._known), key=_by_miss)[
            :STARTS
        ]
        starts = [*known, self._missed(near, goal)] if near else known
        return min((self._descended(one, goal) for one in starts), key=_by_miss)

    @cached_property
    def _known(self) -> list[Reached]:
        """Some actions, rest among them, and where they lead."""
        shares = self.random_shares(SAMPLES, np.random.default_rng([self._seed, 3]))
        shares[0] = 0.0
        return [
            Reached(*one, miss=np.inf)
            for one in zip(shares, *self._settled(shares), strict=True)
        ]

    def _settled(
        self, shares: Shares, start: np.ndarray | None = None
    ) -> tuple[States, np.ndarray]:
        """States and physics at rest, from straight or a shape nearby."""
        size = mujoco.mj_stateSize(self._model, _PHYSICS)
        steps = STEPS if start is None else STEPS_NEARBY
        begin = np.zeros(size) if start is None else start
        actions = self._geometry.actions_at(shares)
        neutral = self._geometry.action_neutral
        commands = (neutral + self._kept * (actions - neutral)).reshape(
            len(shares), 1, -1
        )
        ends = []
        for some in np.split(commands, range(AT_ONCE, len(commands), AT_ONCE)):
            begins = np.tile(begin, (len(some), 1))
            held = np.repeat(some, steps, axis=1)
            paths, _ = self._rollout.rollout(
                [self._model] * len(some), [self._data], begins, held, nstep=steps
            )
            ends.append(paths[:, -1])
        physics = np.concatenate(ends)
        return np.array([self._states_at(one) for one in physics]), physics

    def _states_at(self, physics: np.ndarray) -> States:
        mujoco.mj_setState(self._model, self._data, physics, _PHYSICS)
        mujoco.mj_kinematics(self._model, self._data)
        axes = self._data.site_xmat[self._ends].reshape(-1, 3, 3)[:, :, 2]
        return np.concatenate([self._data.site_xpos[self._ends], axes], axis=-1)

    def _missing(
        self, states: States, goal: Goal
    ) -> Float[np.ndarray, "batch numbers"]:
        """Errors of what is asked [m]."""
        places = goal.position_weights > 0
        ways = goal.axis_weights > 0
        position = states[:, places, POSITION] - goal.positions[places]
        axis = AXIS_LENGTH * self.arm.length * (states[:, ways, AXIS] - goal.axes[ways])
        return np.concatenate(
            [position.reshape(len(states), -1), axis.reshape(len(states), -1)], axis=-1
        )

    def _miss(self, states: States, goal: Goal) -> Float[np.ndarray, " batch"]:
        return np.linalg.norm(self._missing(states, goal), axis=-1)

    def _missed(self, one: Reached, goal: Goal) -> Reached:
        return replace(one, miss=float(self._miss(one.states[None], goal)[0]))

    def _descended(self, start: Reached, goal: Goal) -> Reached:
        """Damped least squares within the discs, slopes by finite differences, and some luck where those fail."""
        best = start
        random = np.random.default_rng([self._seed, 4])
        for _ in range(TRIES):
            probes = best.shares + PROBE * np.eye(best.shares.size).reshape(
                -1, *best.shares.shape
            )
            missing = self._missing(best.states[None], goal)[0]
            slopes = (
                self._missing(self._settled(probes, best.physics)[0], goal) - missing
            ).T / PROBE
            steps = [_damped_step(slopes, missing, damping) for damping in DAMPINGS]
            steps += [size * random.normal(size=best.shares.size) for size in LUCK]
            moved = min(self._tried(best, np.array(steps), goal), key=_by_miss)
            if best.miss - moved.miss < ENOUGH:
                break
            best = moved
        return min(best, moved, key=_by_miss)

    def _tried(self, at: Reached, steps: np.ndarray, goal: Goal) -> list[Reached]:
        """Where steps from a shape lead, shape (steps, shares)."""
        shares = self._within(at.shares + steps.reshape(-1, *at.shares.shape))
        states, physics = self._settled(shares, at.physics)
        return [
            Reached(*one)
            for one in zip(
                shares, states, physics, self._miss(states, goal), strict=True
            )
        ]

    def _within(self, shares: Shares) -> Shares:
        sizes = np.linalg.norm(shares, axis=-1, keepdims=True)
        return shares * np.minimum(1.0, self.most[:, None] / np.maximum(sizes, 1e-12))


def _damped_step(slopes: np.ndarray, missing: np.ndarray, damping: float) -> np.ndarray:
    return -np.linalg.solve(
        slopes.T @ slopes + damping * np.eye(slopes.shape[1]), slopes.T @ missing
    )


def _by_miss(one: Reached) -> float:
    return one.miss


def usable_shares(arm: ArmSpec) -> Float[np.ndarray, " modules"]:
    """Parts of the range of each module's actions that arrive whatever happened before."""
    geometry = ArmGeometry.of(arm)
    tubes = np.deg2rad(per_module(arm, "cable.friction_angle_deg"))
    below = np.concatenate([[0.0], np.cumsum(geometry.bend_limits)[:-1]])
    wrap = per_module(arm, "cable.friction") * (tubes + below)
    if arm.actuation == "tension":
        return np.exp(-wrap)
    pulls = (
        per_module(arm, "bending_stiffness")
        * geometry.bend_limits
        / geometry.lengths
        / geometry.cable_radii
    )
    rubbed = pulls * np.expm1(wrap) / per_module(arm, "cable.stiffness")
    lost = (
        per_cable(arm, "cable.backlash").max(axis=-1)
        + HOMING * arm.motor.homing_error
        + rubbed
    )
    return np.clip(1.0 - lost / geometry.action_scale, 0.0, 1.0)


def _without_memory(arm: ArmSpec) -> ArmSpec:
    """The same arm, damped so that it settles soon."""
    return arm.model_copy(update={"modules": tuple(map(_damped, arm.modules))})


def _damped(module: Module) -> Module:
    cable = module.cable.model_copy(update={"viscous_friction": 0.0})
    return module.model_copy(update={"damping_time": DAMPING_TIME, "cable": cable})
