"""How goals go on, and how plans approach a goal that jumps.

A goal goes on as its preview says, or as it moved. One that is farther from there than an
arm moves in a control step has jumped: an arm that follows at once vibrates. A jump
therefore enters as an offset that decays like a critically damped system of third order,
slower than the slowest mode of the arm. Commands are shaped as by a filter, but motion
that was foreseen, or that an arm can follow, is not delayed.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.estimation.modal_model import FirstMode, ModalFactors
from s2c2a.goals import PREVIEW, Goal, preview_stride

DECAY = 0.6
"""Of offsets, over the frequency of the slowest mode.

With 0.5 to 0.6, jumps of a lightly damped arm end soonest; faster, it vibrates
(`s2c2a reproduce motion`).
"""
JUMP = np.array([1.0, 1.0, 0.5])  # polynomial of an offset at rest

Rows = Float[Array, "rows 3"]
Targets = Float[Array, "targets 3"]


class Approach(NamedTuple):
    """How an arm approaches goals.

    Attributes:
        stride: control steps between two moments of a preview.
        mode: the slowest mode over the payload.
        period: of the control steps [s].
        farthest: that the arm moves an end [m] or its axis in a control step, shape
            (targets, 1); goals that are farther have jumped.
    """

    stride: int
    mode: FirstMode
    period: float
    farthest: Float[np.ndarray, "targets 1"]

    @classmethod
    def of(cls, arm: ArmSpec, factors: ModalFactors | None = None) -> "Approach":
        """The approach of an arm, with the identified factors if there are any."""
        geometry = ArmGeometry.of(arm)
        levers = np.cumsum(geometry.lengths), 1.0 + np.arange(arm.module_count)
        return cls(
            preview_stride(arm.control_period),
            FirstMode.of(arm, factors or ModalFactors.nominal()),
            arm.control_period,
            geometry.step_limit * np.concatenate(levers)[:, None],
        )

    def decay(self, payload: Float[Array, ""] | float) -> Float[Array, ""]:
        """Of offsets in a control step, with a payload at the tip [kg]."""
        frequency = jnp.interp(payload, self.mode.payloads, self.mode.frequencies)
        return DECAY * self.period * frequency


class GoalMotion(NamedTuple):
    """How goals moved, and how far the approach is from them.

    Rows are the targets, the desired positions [m] and axes of all modules, and then
    the centers of obstacles [m].

    Attributes:
        latest: rows of the last control step; NaN before the first.
        step: by which they moved then.
        velocity: [1/step]; in each direction the smaller of the last two steps, and zero
            where these differ in sign.
        expected: targets of the next control step; NaN where nothing was desired.
        offset: of the approach from the targets, as coefficients of a polynomial p: it is
            exp(-t) p(t) at the time t, in units of the decay.
    """

    latest: Rows
    step: Rows
    velocity: Rows
    expected: Targets
    offset: Float[Array, "3 targets 3"]

    @classmethod
    def of(cls, modules: int) -> "GoalMotion":
        """Before the first goal."""
        rows = jnp.zeros_like(_rows(Goal.of(modules)))
        targets = jnp.full((2 * modules, 3), jnp.nan, jnp.float32)
        return cls(rows + jnp.nan, rows, rows, targets, jnp.zeros((3, *targets.shape)))

    def after(
        self,
        goal: Goal,
        states: Float[Array, "modules 6"],
        approach: Approach,
        payload: Float[Array, ""] | float = 0.0,
    ) -> "GoalMotion":
        """The motion after another goal; one that is not finite changes nothing.

        Args:
            goal: for the next state.
            states: of the last plan [m, 1], from which an arm approaches its first goal.
            approach: of the arm.
            payload: at its tip [kg].
        """
        now = _rows(goal)
        count = len(now)  # goals of a batch have no rows for obstacles
        step = jnp.nan_to_num(now - self.latest[:count])
        before = self.step[:count]
        velocity = jnp.where(abs(step) < abs(before), step, before)
        velocity = jnp.where(step * before > 0.0, velocity, 0.0)
        moved = self._replace(
            latest=self.latest.at[:count].set(now),
            step=self.step.at[:count].set(step),
            velocity=self.velocity.at[:count].set(velocity),
        )
        targets = _targets(goal)
        weights = jnp.concatenate([goal.position_weights, goal.axis_weights])
        is_desired = weights[:, None] > 0.0
        present = jnp.concatenate(jnp.split(jnp.asarray(states), 2, axis=1))
        is_first = ~jnp.isfinite(self.expected)
        jump = targets - jnp.where(is_first, present, self.expected)
        distance = jnp.linalg.norm(jump, axis=1, keepdims=True)
        jump = jnp.where(distance > approach.farthest, jump, 0.0)
        begun = self.offset - JUMP[:, None, None] * jump
        offset = _later(begun, approach.decay(payload))
        next_targets = moved.targets_at(goal, approach.stride, 1)
        moved = moved._replace(
            expected=jnp.where(is_desired, next_targets, jnp.nan),
            offset=jnp.where(is_desired, offset, 0.0),
        )
        told = (value for name, value in goal._asdict().items() if name != "preview")
        is_finite = jnp.stack([jnp.isfinite(value).all() for value in told]).all()
        return jax.tree.map(
            lambda new, old: jnp.where(is_finite, new, old), moved, self
        )

    def ahead(
        self,
        goal: Goal,
        approach: Approach,
        payload: Float[Array, ""] | float = 0.0,
    ) -> Goal:
        """Goals of the next moments, with these as the first axis, as the arm approaches.

        Args:
            goal: of the last step, which this motion knows.
            approach: of the arm.
            payload: at its tip [kg].
        """
        decay = approach.decay(payload)
        steps = _steps(approach.stride)[1:, None, None]
        offsets = jax.vmap(lambda step: _later(self.offset, step * decay)[0])(steps)
        targets = self._foreseen(goal, approach.stride) + offsets
        positions, axes = jnp.split(targets, 2, axis=1)
        lengths = jnp.linalg.norm(axes, axis=-1, keepdims=True)
        obstacles = jnp.asarray(goal.obstacles)
        velocities = self.velocity[targets.shape[1] :][: len(obstacles)]
        changed = {
            "positions": positions,
            "axes": axes / jnp.maximum(lengths, np.finfo(np.float32).tiny),
            "obstacles": obstacles + steps * velocities,
        }
        same = {
            name: jnp.broadcast_to(value, (PREVIEW, *np.shape(value)))
            for name, value in goal._asdict().items()
        }
        return Goal(**(same | changed))  # type: ignore[arg-type]

    def targets_at(self, goal: Goal, stride: int, step: int) -> Targets:
        """Targets some control steps after a goal."""
        known = jnp.concatenate([_targets(goal)[None], self._foreseen(goal, stride)])
        steps = _steps(stride)
        after = int(np.searchsorted(steps, step))
        share = (step - steps[after - 1]) / (steps[after] - steps[after - 1])
        return known[after - 1] + share * (known[after] - known[after - 1])

    def _foreseen(self, goal: Goal, stride: int) -> Float[Array, "moments targets 3"]:
        """Targets of the next moments: as told, else with constant velocity."""
        told = jnp.asarray(goal.preview)
        told = jnp.concatenate(jnp.split(told, 2, axis=-1), axis=1)
        targets = _targets(goal)
        steps = _steps(stride)[1:, None, None]
        goes_on = targets + steps * self.velocity[: len(targets)]
        return jnp.where(jnp.isnan(told), goes_on, told)


def _later(offset: Float[Array, "3 *rest"], time: Array) -> Float[Array, "3 *rest"]:
    """The polynomial of an offset as it is a time later."""
    value, slope, curve = offset
    later = value + time * (slope + time * curve), slope + 2.0 * time * curve, curve
    return jnp.exp(-time) * jnp.stack(later)


def _steps(stride: int) -> np.ndarray:
    """Control steps from a goal to itself and to the moments of its preview."""
    return np.concatenate([[0], stride * np.arange(1, PREVIEW + 1) - 1])


def _targets(goal: Goal) -> Targets:
    values = goal.positions, goal.axes
    return jnp.concatenate([jnp.asarray(value, jnp.float32) for value in values])


def _rows(goal: Goal) -> Rows:
    return jnp.concatenate([_targets(goal), jnp.asarray(goal.obstacles, jnp.float32)])
