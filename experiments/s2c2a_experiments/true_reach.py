"""The true reach of an arm: a search over resting shapes of its simulation.

The simulated arm has its mismatch and its age, but no memory (docs/results/protocol.md): its
cables follow the motors at once. Instead, the range of the motors is reduced by the
most that backlash, friction and homing errors can take.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout

from s2c2a.arm import ArmGeometry, ArmSpec, Module
from s2c2a.arm.geometry import directions_at, per_cable, per_module
from s2c2a.goals import Goal
from s2c2a.robots.simulation import FIDELITIES
from s2c2a.robots.simulation.chain import build_model
from s2c2a.spaces import AXIS, POSITION, States

Residuals = Callable[[States], Float[np.ndarray, "batch residuals"]]
"""States of a batch -> errors [m]."""
NormalizedActions = Float[np.ndarray, "*batch modules 2"]
"""Actions as fractions of their range, vectors in the unit disc of each module."""

DAMPING_TIME = 0.3  # s; near critical damping
TIME_STEP = 0.02  # s
SETTLING_STEPS = 300  # from the straight arm to rest
NEARBY_SETTLING_STEPS = 80  # from one shape to a near one
BATCH_SIZE = 64  # simulations in one call
HOMING_MARGIN = 2.0  # standard deviations of the homing error

SAMPLES = 512  # random actions whose resting shapes are known
STARTS = 3  # best samples from which a search starts
MAX_ITERATIONS = 12
FINITE_DIFFERENCE = 0.02
SMALLEST_GAIN = 2e-5  # m; a search stops at an iteration that gains less
DAMPINGS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # of the least-squares steps tried
RANDOM_STEPS = (0.01, 0.02, 0.03, 0.05, 0.1)  # sizes of the random steps tried
AXIS_LENGTH = 0.1  # of the arm's length; converts an axis error of 1 rad to meters
_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS
_by_error = attrgetter("error")


@dataclass(frozen=True)
class RestingShape:
    """A resting shape and its distance from a goal.

    Attributes:
        actions: normalized actions, shape (modules, 2).
        states: of the module ends, base frame, shape (modules, 6).
        physics: MuJoCo state.
        error: norm of position and axis errors, the latter scaled by `AXIS_LENGTH` [m].
    """

    actions: NormalizedActions
    states: States
    physics: np.ndarray
    error: float


class TrueReach:
    """Search over the resting shapes of an arm.

    Args:
        arm: with its mismatch; its drift has fully developed.
    """

    def __init__(self, arm: ArmSpec):
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._drift_gain = 1.0 - per_module(arm, "mismatch.drift")[:, None]
        self.usable_range = usable_range(arm)
        self._model = build_model(_without_memory(arm), FIDELITIES["fast"])
        self._model.opt.timestep = TIME_STEP
        self._data = mujoco.MjData(self._model)
        self._rollout = Rollout(nthread=0)
        self._ends = [
            self._model.site(f"end_{module}").id for module in range(arm.module_count)
        ]

    def states(self, actions: NormalizedActions) -> States:
        """States at rest, base frame, shape (batch, modules, 6).

        Args:
            actions: normalized actions, shape (batch, modules, 2).
        """
        return self._settle(actions)[0]

    def random_actions(
        self, count: int, random: np.random.Generator
    ) -> NormalizedActions:
        """Actions sampled uniformly in the disc of each module's usable range.

        Args:
            count: number of samples.
            random: generator.
        """
        shape = (2, count, len(self.usable_range))
        angles, squares = random.uniform(0, 2 * np.pi, shape)
        radii = self.usable_range * np.sqrt(squares / (2 * np.pi))
        return radii[..., None] * directions_at(angles)

    def nearest(self, goal: Goal, start: RestingShape | None = None) -> RestingShape:
        """The resting shape nearest to a goal that a local search finds.

        Args:
            goal: one goal; its obstacles do not count.
            start: an additional start, such as the shape for the goal before.
        """
        return self.least(partial(self._residuals, goal=goal), start)

    def least(
        self, residuals: Residuals, start: RestingShape | None = None
    ) -> RestingShape:
        """The resting shape with the least norm of residuals that a local search finds.

        Args:
            residuals: of a batch of states [m].
            start: an additional start.
        """
        samples = [_with_error(shape, residuals) for shape in self._samples]
        starts = sorted(samples, key=_by_error)[:STARTS]
        if start:
            starts.append(_with_error(start, residuals))
        shapes = [self._descend(shape, residuals) for shape in starts]
        return min(shapes, key=_by_error)

    @cached_property
    def _samples(self) -> list[RestingShape]:
        """Resting shapes of random actions and of no action."""
        random = np.random.default_rng([0, 3])
        actions = self.random_actions(SAMPLES, random)
        actions[0] = 0.0
        states, physics = self._settle(actions)
        return _resting_shapes(actions, states, physics, np.full(SAMPLES, np.inf))

    def _settle(
        self, actions: NormalizedActions, start: np.ndarray | None = None
    ) -> tuple[States, np.ndarray]:
        """States and physics at rest, simulated from straight or from a given state."""
        if start is None:
            start = np.zeros(mujoco.mj_stateSize(self._model, _PHYSICS))
            steps = SETTLING_STEPS
        else:
            steps = NEARBY_SETTLING_STEPS
        neutral = self._geometry.action_neutral
        displacements = self._geometry.actions_at(actions) - neutral
        commands = neutral + self._drift_gain * displacements
        commands = commands.reshape(len(actions), 1, -1)
        ends = []
        for batch in np.split(commands, range(BATCH_SIZE, len(commands), BATCH_SIZE)):
            models = [self._model] * len(batch)
            starts = np.tile(start, (len(batch), 1))
            controls = np.repeat(batch, steps, axis=1)
            paths, _ = self._rollout.rollout(
                models, [self._data], starts, controls, nstep=steps
            )
            ends.append(paths[:, -1])
        physics = np.concatenate(ends)
        return np.array([self._states_at(state) for state in physics]), physics

    def _states_at(self, physics: np.ndarray) -> States:
        mujoco.mj_setState(self._model, self._data, physics, _PHYSICS)
        mujoco.mj_kinematics(self._model, self._data)
        turns = self._data.site_xmat[self._ends]
        axes = turns.reshape(-1, 3, 3)[:, :, 2]
        return np.concatenate([self._data.site_xpos[self._ends], axes], axis=-1)

    def _residuals(
        self, states: States, goal: Goal
    ) -> Float[np.ndarray, "batch residuals"]:
        """Errors of the desired positions and axes [m]."""
        count = len(states)
        with_position = goal.position_weights > 0
        with_axis = goal.axis_weights > 0
        positions = states[:, with_position, POSITION] - goal.positions[with_position]
        axes = states[:, with_axis, AXIS] - goal.axes[with_axis]
        axes = AXIS_LENGTH * self.arm.length * axes
        return np.concatenate(
            [positions.reshape(count, -1), axes.reshape(count, -1)], axis=-1
        )

    def _descend(self, start: RestingShape, residuals: Residuals) -> RestingShape:
        """Damped least squares with finite differences, and random steps besides."""
        best = start
        random = np.random.default_rng([0, 4])
        size = start.actions.size
        for _ in range(MAX_ITERATIONS):
            errors, jacobian = self._linearize(best, residuals)
            steps = [_damped_step(jacobian, errors, each) for each in DAMPINGS]
            steps += [length * random.normal(size=size) for length in RANDOM_STEPS]
            candidate = self._best_step(best, np.array(steps), residuals)
            gain = best.error - candidate.error
            best = min(best, candidate, key=_by_error)
            if gain < SMALLEST_GAIN:
                break
        return best

    def _linearize(
        self, shape: RestingShape, residuals: Residuals
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of a shape, and their Jacobian with respect to the actions."""
        units = np.eye(shape.actions.size).reshape(-1, *shape.actions.shape)
        probes = shape.actions + FINITE_DIFFERENCE * units
        errors = residuals(shape.states[None])[0]
        probe_states, _ = self._settle(probes, shape.physics)
        differences = residuals(probe_states) - errors
        return errors, differences.T / FINITE_DIFFERENCE

    def _best_step(
        self, shape: RestingShape, steps: np.ndarray, residuals: Residuals
    ) -> RestingShape:
        """The best resting shape among those after steps of shape (steps, actions)."""
        actions = shape.actions + steps.reshape(-1, *shape.actions.shape)
        actions = self._limit(actions)
        states, physics = self._settle(actions, shape.physics)
        errors = np.linalg.norm(residuals(states), axis=-1)
        return min(_resting_shapes(actions, states, physics, errors), key=_by_error)

    def _limit(self, actions: NormalizedActions) -> NormalizedActions:
        norms = np.linalg.norm(actions, axis=-1, keepdims=True)
        most = self.usable_range[:, None]
        return actions * np.minimum(1.0, most / np.maximum(norms, 1e-12))


def _resting_shapes(
    actions: NormalizedActions, states: States, physics: np.ndarray, errors: np.ndarray
) -> list[RestingShape]:
    rows = zip(actions, states, physics, errors, strict=True)
    return [RestingShape(*row) for row in rows]


def _with_error(shape: RestingShape, residuals: Residuals) -> RestingShape:
    error = float(np.linalg.norm(residuals(shape.states[None])[0]))
    return replace(shape, error=error)


def _damped_step(
    jacobian: np.ndarray, residuals: np.ndarray, damping: float
) -> np.ndarray:
    normal_matrix = jacobian.T @ jacobian + damping * np.eye(jacobian.shape[1])
    return -np.linalg.solve(normal_matrix, jacobian.T @ residuals)


def usable_range(arm: ArmSpec) -> Float[np.ndarray, " modules"]:
    """Fraction of each module's action range that takes effect after any history.

    Friction reduces tensions by exp(-mu * angle); backlash, the homing error and the
    stretch of cables under friction reduce displacements.
    """
    geometry = ArmGeometry.of(arm)
    tube_angles = np.deg2rad(per_module(arm, "cable.friction_angle_deg"))
    bends_below = np.concatenate([[0.0], np.cumsum(geometry.bend_limits)[:-1]])
    exponents = per_module(arm, "cable.friction") * (tube_angles + bends_below)
    if arm.actuation == "tension":
        return np.exp(-exponents)
    moments = (
        per_module(arm, "bending_stiffness") * geometry.bend_limits / geometry.lengths
    )
    tensions = moments / geometry.cable_radii
    stretch = tensions * np.expm1(exponents) / per_module(arm, "cable.stiffness")
    backlash = per_cable(arm, "cable.backlash").max(axis=-1)
    lost = backlash + HOMING_MARGIN * arm.motor.homing_error + stretch
    return np.clip(1.0 - lost / geometry.action_scale, 0.0, 1.0)


def _without_memory(arm: ArmSpec) -> ArmSpec:
    """The same arm without viscous friction, damped such that it settles quickly."""
    return arm.model_copy(update={"modules": tuple(map(_damped, arm.modules))})


def _damped(module: Module) -> Module:
    cable = module.cable.model_copy(update={"viscous_friction": 0.0})
    return module.model_copy(update={"damping_time": DAMPING_TIME, "cable": cable})
