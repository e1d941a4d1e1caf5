"""How goals go on, and how plans approach a goal that jumps.

A goal goes on as its preview says, or as it moved. One that is farther from there than an
arm moves in a control step has jumped: an arm that follows at once vibrates. A jump
therefore enters as an offset that decays like a critically damped system of third order,
slower than the slowest mode of the arm. Commands are shaped as by a filter, but motion
that was foreseen, or that an arm can follow, is not delayed.

Beside obstacles, a point that passes them with the target of the tip stands for it.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.estimation.modal_model import ModalFactors, first_mode
from s2c2a.goals import PREVIEW, Goal, preview_stride
from s2c2a.kinematics import limit_lengths, norm
from s2c2a.kinematics.bends import Scalar, Truth
from s2c2a.obstacles import distances, swept

# of offsets, over the frequency of the slowest mode; measured in
# docs/contribute/decisions.md#a-horizon-in-place-of-a-search-and-payloads-within-it
DECAY = 0.6
# rad/s, chosen: an approach takes 3 s at most, also where an arm that gravity nearly
# topples has no slower vibration, but a slower mode
SLOWEST = 2.0 * np.pi * 0.5
# around obstacles, of `Approach.farthest`; measured on 20 drawn paths through spheres: with
# 0.1 the tip falls behind its target, and at 0.3 arms vibrate
PACE = 0.2
# coefficients of an offset of one, at rest at first
AT_REST = np.array([1.0, 1.0, 0.5])

Rows = Float[Array, "rows 3"]
Targets = Float[Array, "targets 3"]
Point = Float[Array, "3"]
# J J^T of the tip, with its slopes by bends [m2]: large where it moves with little bend
Mobility = Float[Array, "3 3"]


class Approach(NamedTuple):
    """How an arm approaches goals.

    Attributes:
        stride: control steps between two moments of a preview.
        payloads: at the tip [kg], increasing, shape (payloads,).
        decays: of offsets in a control step, with each of these payloads.
        farthest: way of an end [m] or its axis from one moment to the next, if the base
            (for axes, each module) bends by the step limit in every control step, shape
            (targets, 1); goals that are farther have jumped.
        margin: that the tip keeps from thresholds of obstacles [m]; None if none.
    """

    stride: int
    payloads: Float[np.ndarray, " payloads"]
    decays: Float[np.ndarray, " payloads"]
    farthest: Float[np.ndarray, "targets 1"]
    margin: float | None = None

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
        passes: whether the tip passes an obstacle beside its target.
    """

    latest: Rows
    step: Rows
    expected: Targets
    is_known: Float[Array, "targets 1"]
    offset: Float[Array, "3 targets 3"]
    passes: Truth

    @classmethod
    def of(cls, modules: int) -> "GoalMotion":
        """Before the first goal."""
        rows = jnp.zeros_like(_rows(Goal.of(modules)))
        targets = rows[: 2 * modules]
        offset = jnp.stack([targets] * 3)
        passes = jnp.asarray(False)
        return cls(rows, rows, targets, targets[:, :1], offset, passes)

    def stays(self, goal: Goal) -> Truth:
        """Whether a goal is as the last one was."""
        now = _rows(goal)
        is_same = (now == self.latest[: len(now)]).all()
        return is_same & (_desired(goal) == self.is_known).all()

    def after(
        self,
        goal: Goal,
        states: Float[Array, "modules 6"],
        approach: Approach,
        payload: Scalar | float = 0.0,
    ) -> tuple["GoalMotion", Goal]:
        """The motion after another goal, and the goals of the next moments.

        What no preview has goes on with constant velocity: in each direction with the
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
        # a preview has no obstacles
        others = (0, 0), (0, len(goal.obstacles)), (0, 0)
        preview = jnp.split(jnp.asarray(goal.preview), 2, axis=-1)
        path = jnp.pad(jnp.concatenate(preview, axis=1), others, constant_values=np.nan)
        steps = approach.stride * np.arange(1.0, PREVIEW + 1.0)[:, None, None] - 1.0
        foreseen = jnp.where(jnp.isnan(path), now + steps * velocity, path)
        following = foreseen[1]
        if approach.stride > 1:
            following = now + (foreseen[0] - now) / (approach.stride - 1)
        is_desired = _desired(goal)
        targets = len(is_desired)
        present = jnp.concatenate(jnp.split(states, 2, axis=1))
        jump = now[:targets] - jnp.where(self.is_known > 0.0, self.expected, present)
        distance = jnp.linalg.norm(jump, axis=1, keepdims=True)
        jump = jnp.where(distance > approach.farthest, jump, 0.0)
        decay = jnp.interp(payload, approach.payloads, approach.decays)
        offset = is_desired * _later(self.offset - AT_REST[:, None, None] * jump, decay)
        offsets = jax.vmap(lambda step: _later(offset, step * decay)[0])(steps)
        motion = self._replace(
            latest=self.latest.at[:count].set(now),
            step=self.step.at[:count].set(step),
            expected=following[:targets],
            is_known=is_desired,
            offset=offset,
        )
        # an arm that is to be clear of obstacles only then leaves late, fast, and vibrates
        ways = velocity[targets:] * approach.stride * PREVIEW
        thresholds, cores = swept(goal.thresholds, goal.cores, ways)
        covering = goal._replace(thresholds=thresholds, cores=cores)
        rows = foreseen.at[:, :targets].add(offsets).at[:, targets:].add(ways / 2.0)
        return motion, _goals(covering, rows)

    def beside(
        self, ahead: Goal, tip: Point, mobility: Mobility, approach: Approach
    ) -> tuple["GoalMotion", Goal]:
        """Goals of the next moments whose tip passes obstacles, and does not enter them.

        A point begins at the tip and follows, at a limited pace, its target or a clear
        place beside it. The shortest way out of an obstacle turns around at once where a
        target comes by the center. So it is taken from a place `_aside`.

        Args:
            ahead: goals of the next moments, as of `after`.
            tip: of the last plan [m].
            mobility: there; ways aside that the tip can hardly take are no ways.
            approach: of the arm, with a margin.
        """
        positions = jnp.asarray(ahead.positions)
        targets = positions[:, -1]
        kept = ahead.thresholds + (approach.margin or 0.0) * (ahead.thresholds > 0.0)
        scenes = ahead._replace(thresholds=kept)
        gaps = jax.vmap(_gap)(targets, scenes)
        enters = gaps.min() < 0.0

        def pass_by():
            ways = jnp.gradient(targets, axis=0)
            moments = scenes, targets, ways
            deepest = jax.tree.map(lambda rows: rows[gaps.argmin()], moments)

            def follow(point: Point, moment):
                scene, target, pace = moment
                aside = _aside(point - target, mobility, *deepest)
                place = _out(target, _normal(target + aside, scene), scene)
                move = limit_lengths(place - point, pace)
                # it takes half of the room before an obstacle at most: an arm that stops at
                # once swings into it; with a fifth, the tip falls behind its target
                room, normal = jax.value_and_grad(_gap)(point, scene)
                beyond = move @ normal + jnp.maximum(room, 0.0) / 2.0
                point = point + move - jnp.minimum(beyond, 0.0) * normal
                # twice, since it may enter another obstacle
                for _ in range(2):
                    point = _out(point, _normal(point, scene), scene)
                return point, point

            paces = PACE * approach.farthest[positions.shape[1] - 1] + norm(ways)
            _, points = jax.lax.scan(follow, tip, (scenes, targets, paces))
            is_behind = norm(targets[0] - tip) > paces[0]
            passes = (enters | is_behind) & (ahead.position_weights[0, -1] > 0.0)
            return passes, jnp.where(passes, points, targets)

        passes, points = jax.lax.cond(
            self.passes | enters, pass_by, lambda: (jnp.asarray(False), targets)
        )
        passed = {"positions": positions.at[:, -1].set(points)}
        return self._replace(passes=passes), ahead._replace(**passed)  # type: ignore[arg-type]


def _gap(point: Point, scene: Goal) -> Scalar:
    """Signed distance of a point from the thresholds of obstacles [m]."""
    gaps = distances(point, scene.obstacles, scene.cores) - scene.thresholds
    known = jnp.append(jnp.where(scene.thresholds > 0.0, gaps, jnp.inf), jnp.inf)
    # as in `obstacles`, no `min`: its slope fails where entries are rounded twice
    return known[jnp.argmin(known)]


_normal = jax.grad(_gap)


def _out(point: Point, direction: Point, scene: Goal) -> Point:
    """A point, moved in a direction by its depth in an obstacle."""
    return point - jnp.minimum(_gap(point, scene), 0.0) * direction


def _aside(
    lead: Point, mobility: Mobility, scene: Goal, target: Point, way: Point
) -> Point:
    """Half the depth of a target, across its way, to where the tip is and moves well.

    Args:
        lead: from the target to the point that follows [m].
        mobility: of the tip.
        scene: obstacles, with what is kept from them.
        target: where it is deepest in them [m].
        way: of the target there [m].
    """
    along = _unit(way)
    across = jnp.eye(3) - jnp.outer(along, along)
    normal = _normal(target + across @ lead, scene)
    return _out(target, _unit(across @ mobility @ normal) / 2.0, scene) - target


def _unit(vectors: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    lengths = jnp.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / jnp.maximum(lengths, np.finfo(np.float32).tiny)


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


def _goals(goal: Goal, rows: Float[Array, "moments rows 3"]) -> Goal:
    """Goals with these rows and moments as the first axis."""
    modules = len(goal.positions)
    positions, axes, obstacles = jnp.split(rows, (modules, 2 * modules), axis=1)
    changed = {"positions": positions, "axes": _unit(axes), "obstacles": obstacles}
    same = {
        name: jnp.broadcast_to(value, (PREVIEW, *np.shape(value)))
        for name, value in goal._asdict().items()
    }
    return Goal(**(same | changed))  # type: ignore[arg-type]
