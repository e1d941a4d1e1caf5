"""How goals go on, and how plans approach a goal that jumps.

A goal goes on as its preview says, or as it moved. One that is farther from there than an
arm moves in a control step has jumped: an arm that follows at once vibrates. A jump
therefore enters as an offset that decays like a critically damped system of third order,
slower than the slowest mode of the arm. Commands are shaped as by a filter, but motion
that was foreseen, or that an arm can follow, is not delayed.

Beside obstacles, a point that slides along them stands for the target of the tip.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.estimation.modal_model import ModalFactors, first_mode
from s2c2a.goals import PREVIEW, Goal, preview_stride
from s2c2a.kinematics import limit_lengths
from s2c2a.obstacles import distances, swept

DECAY = 0.6
"""Of offsets, over the frequency of the slowest mode; measured in
docs/contribute/decisions.md#a-horizon-in-place-of-a-search-and-payloads-within-it.
"""
SLOWEST = 2.0 * np.pi * 0.5
"""Frequency [rad/s], chosen: an approach takes 3 s at most, also where an arm that gravity
nearly topples has no slower vibration, but a slower mode."""
PACE = 0.2
"""Along obstacles, of `Approach.farthest`; measured on 20 drawn paths through spheres: with
0.1 the tip falls behind its target, and at 0.3 arms vibrate."""
AT_REST = np.array([1.0, 1.0, 0.5])
"""Coefficients of an offset of one that begins at rest."""

Rows = Float[Array, "rows 3"]
Targets = Float[Array, "targets 3"]


class Approach(NamedTuple):
    """How an arm approaches goals.

    Attributes:
        stride: control steps between two moments of a preview.
        payloads: at the tip [kg], increasing, shape (payloads,).
        decays: of offsets in a control step, with each of these payloads.
        farthest: way of an end [m] or its axis from one moment to the next, if the base
            (for axes, each module) bends by the step limit in every control step, shape
            (targets, 1); goals that are farther have jumped.
    """

    stride: int
    payloads: Float[np.ndarray, " payloads"]
    decays: Float[np.ndarray, " payloads"]
    farthest: Float[np.ndarray, "targets 1"]

    @classmethod
    def of(cls, arm: ArmSpec, factors: ModalFactors) -> "Approach":
        """The approach of an arm with these factors of stiffness and damping."""
        payloads, frequencies = first_mode(arm, factors)
        geometry = ArmGeometry.of(arm)
        stride = preview_stride(arm.control_period)
        levers = [np.cumsum(geometry.lengths), 1.0 + np.arange(arm.module_count)]
        return cls(
            stride,
            payloads,
            DECAY * np.maximum(frequencies, SLOWEST) * arm.control_period,
            stride * geometry.step_limit * np.concatenate(levers)[:, None],
        )


class GoalMotion(NamedTuple):
    """How goals moved, and how far the approach is from them.

    Rows are the targets, the desired positions [m] and axes of all modules, and then
    the centers of obstacles [m].

    Attributes:
        latest: rows of the last control step.
        step: by which they moved then.
        expected: targets of the next control step.
        is_known: one where a target was desired, else zero, shape (targets, 1).
        offset: of the approach from the targets, as coefficients of a polynomial p: it is
            exp(-t) p(t) at the time t, in units of the decay.
        aside: of the target of the tip, the point that slides along obstacles [m]; zero
            where none does.
    """

    latest: Rows
    step: Rows
    expected: Targets
    is_known: Float[Array, "targets 1"]
    offset: Float[Array, "3 targets 3"]
    aside: Float[Array, "3"]

    @classmethod
    def of(cls, modules: int) -> "GoalMotion":
        """Before the first goal."""
        rows = jnp.zeros_like(_rows(Goal.of(modules)))
        targets = rows[: 2 * modules]
        offset = jnp.stack([targets] * 3)
        return cls(rows, rows, targets, targets[:, :1], offset, targets[0])

    def stays(self, goal: Goal) -> Bool[Array, ""]:
        """Whether a goal is as the last one was."""
        now = _rows(goal)
        is_same = (now == self.latest[: len(now)]).all()
        return is_same & (_desired(goal) == self.is_known).all()

    def after(
        self,
        goal: Goal,
        states: Float[Array, "modules 6"],
        approach: Approach,
        payload: Float[Array, ""] | float = 0.0,
    ) -> tuple["GoalMotion", Goal]:
        """The motion after another goal, and the goals of the next moments.

        What no preview tells goes on with constant velocity: in each direction with the
        smaller of its last two steps, and not where these differ in sign. Obstacles that
        move cover where they will be as far as a plan sees.

        Args:
            goal: for the next state.
            states: of the last plan [m, 1], from which an arm approaches its first goal.
            approach: of the arm.
            payload: at its tip [kg].

        Returns:
            The goals with moments as the first axis, as the arm approaches them.
        """
        now = _rows(goal)
        count = len(now)  # goals of a batch have no rows for obstacles
        step = now - self.latest[:count]
        # velocity of rows that made these steps; a jump is no motion
        before = self.step[:count]
        smaller = jnp.where(abs(step) < abs(before), step, before)
        velocity = jnp.where(step * before > 0.0, smaller, 0.0)
        told = _told(goal)
        steps = approach.stride * np.arange(1.0, PREVIEW + 1.0)[:, None, None] - 1.0
        foreseen = jnp.where(jnp.isnan(told), now + steps * velocity, told)
        if approach.stride > 1:
            following = now + (foreseen[0] - now) / (approach.stride - 1)
        else:
            following = foreseen[1]
        is_desired = _desired(goal)
        targets = len(is_desired)
        present = jnp.concatenate(jnp.split(states, 2, axis=1))
        jump = now[:targets] - jnp.where(self.is_known > 0.0, self.expected, present)
        distance = jnp.linalg.norm(jump, axis=1, keepdims=True)
        jump = jnp.where(distance > approach.farthest, jump, 0.0)
        decay = jnp.interp(payload, approach.payloads, approach.decays)
        offset = is_desired * _later(self.offset - AT_REST[:, None, None] * jump, decay)
        offsets = jax.vmap(lambda step: _later(offset, step * decay)[0])(steps)
        slides = (self.aside != 0.0).any()
        aside = self.aside - slides * step[len(goal.positions) - 1]
        latest, latest_step = self.latest.at[:count], self.step.at[:count]
        motion = GoalMotion(
            latest.set(now),
            latest_step.set(step),
            following[:targets],
            is_desired,
            offset,
            aside,
        )
        # an arm that is to be clear of obstacles only then leaves late, fast, and vibrates
        ways = velocity[targets:] * approach.stride * PREVIEW
        thresholds, cores = swept(goal.thresholds, goal.cores, ways)
        covering = goal._replace(thresholds=thresholds, cores=cores)
        rows = foreseen.at[:, :targets].add(offsets).at[:, targets:].add(ways / 2.0)
        return motion, _goals(covering, rows)

    def beside(
        self, ahead: Goal, tip: Float[Array, "3"], approach: Approach, margin: float
    ) -> tuple["GoalMotion", Goal]:
        """Goals of the next moments whose tip slides along obstacles, not into them.

        A point begins at the tip, follows its target at a limited pace, and is moved out
        of what it enters, until it has come to a target that is clear.

        Args:
            ahead: goals of the next moments, as of `after`.
            tip: of the last plan [m].
            approach: of the arm.
            margin: that the tip keeps from thresholds [m].
        """
        positions = jnp.asarray(ahead.positions)
        last = positions.shape[1] - 1
        targets, target = positions[:, last], self.latest[last]
        steps = jnp.linalg.norm(jnp.diff(targets, axis=0), axis=1)
        farthest = approach.farthest[last, 0]
        longest = PACE * farthest + jnp.append(steps[:1], steps)

        def gap_of(point, scene: Goal):
            gaps = distances(point, scene.obstacles, scene.cores) - scene.thresholds
            return jnp.min(gaps - margin, initial=jnp.inf, where=scene.thresholds > 0.0)

        def out_of(scene: Goal, point):
            gap, normal = jax.value_and_grad(gap_of)(point, scene)
            return point - jnp.minimum(gap, 0.0) * normal

        def follow(point, moment):
            scene, target, longest = moment
            point = point + limit_lengths(out_of(scene, target) - point, longest)
            # twice, since it may enter another obstacle
            point = out_of(scene, out_of(scene, point))
            return point, point

        slides = (self.aside != 0.0).any()
        is_within = (jax.vmap(gap_of)(targets, ahead) < 0.0).any()

        def slide():
            # a tip that cannot follow keeps the point near; half a step is chosen
            start = tip + slides * limit_lengths(
                target + self.aside - tip, farthest / 2
            )
            _, points = jax.lax.scan(follow, start, (ahead, targets, longest))
            is_behind = slides & (jnp.linalg.norm(targets[0] - start) > longest[0])
            is_beside = is_within | is_behind
            is_beside &= ahead.position_weights[0, last] > 0.0
            points = jnp.where(is_beside, points, targets)
            aside = start + (points[0] - start) / approach.stride - target
            motion = self._replace(aside=jnp.where(is_beside, aside, 0.0))
            return motion, ahead._replace(positions=positions.at[:, last].set(points))

        return jax.lax.cond(slides | is_within, slide, lambda: (self, ahead))


def _later(offset: Float[Array, "3 *rest"], time: Array) -> Float[Array, "3 *rest"]:
    """The polynomial of an offset as it is a time later."""
    value, slope, curve = offset
    later = value + time * (slope + time * curve), slope + 2.0 * time * curve, curve
    return jnp.exp(-time) * jnp.stack(later)


def _desired(goal: Goal) -> Float[Array, "targets 1"]:
    weights = jnp.concatenate([goal.position_weights, goal.axis_weights])
    return (weights[:, None] > 0.0).astype(jnp.float32)


def _rows(goal: Goal) -> Rows:
    values = goal.positions, goal.axes, goal.obstacles
    return jnp.concatenate([jnp.asarray(value, jnp.float32) for value in values])


def _told(goal: Goal) -> Float[Array, "moments rows 3"]:
    """Rows that a preview tells; NaN where it does not, as of obstacles."""
    targets = jnp.concatenate(jnp.split(jnp.asarray(goal.preview), 2, axis=-1), axis=1)
    gap = (0, 0), (0, len(goal.obstacles)), (0, 0)
    return jnp.pad(targets, gap, constant_values=np.nan)


def _goals(goal: Goal, rows: Float[Array, "moments rows 3"]) -> Goal:
    """Goals with these rows and moments as the first axis."""
    modules = len(goal.positions)
    positions, axes, obstacles = jnp.split(rows, (modules, 2 * modules), axis=1)
    lengths = jnp.linalg.norm(axes, axis=-1, keepdims=True)
    axes = axes / jnp.maximum(lengths, np.finfo(np.float32).tiny)
    changed = {"positions": positions, "axes": axes, "obstacles": obstacles}
    same = {
        name: jnp.broadcast_to(value, (PREVIEW, *np.shape(value)))
        for name, value in goal._asdict().items()
    }
    return Goal(**(same | changed))  # type: ignore[arg-type]
