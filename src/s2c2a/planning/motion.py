"""How goals go on: as their preview says, or as they moved."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.goals import PREVIEW, Goal


class GoalMotion(NamedTuple):
    """Where the goals of the last two control steps were.

    Attributes:
        recent: positions [m], axes and centers of obstacles [m] of both goals, the newer
            one first, shape (2, 2 modules + obstacles, 3); NaN before the first goals.
    """

    recent: Float[Array, "2 rows 3"]

    @classmethod
    def of(cls, modules: int) -> "GoalMotion":
        """Before the first goal."""
        rows = _rows(Goal.of(modules))
        return cls(jnp.full((2, *rows.shape), jnp.nan, jnp.float32))

    def after(self, goal: Goal) -> "GoalMotion":
        """The motion after another goal; one that is not finite changes nothing."""
        rows = _rows(goal)
        latest = self.recent[0].at[: len(rows)].set(rows)
        recent = jnp.stack([latest, self.recent[0]])
        return GoalMotion(jnp.where(jnp.isfinite(rows).all(), recent, self.recent))

    def ahead(self, goal: Goal, stride: int) -> Goal:
        """The goals of the next moments, with these as the first axis.

        What no preview tells moves on with constant velocity: in each direction with
        the smaller of its last two steps, and not where these differ in sign, since a
        jump is no motion.

        Args:
            goal: for the next state.
            stride: control steps between two moments.
        """
        now = _rows(goal)
        # goals of a batch have no rows for obstacles
        latest, earlier = self.recent[:, : len(now)]
        step = now - latest
        before = latest - earlier
        velocity = jnp.where(abs(step) < abs(before), step, before)
        velocity = jnp.where(step * before > 0.0, velocity, 0.0)
        later = stride * jnp.arange(1.0, PREVIEW + 1.0)[:, None, None] - 1.0
        predicted = now + later * velocity
        modules = len(goal.positions)
        positions, axes, obstacles = jnp.split(
            predicted, (modules, 2 * modules), axis=1
        )
        told = jnp.asarray(goal.preview)
        positions = jnp.where(jnp.isnan(told[..., :3]), positions, told[..., :3])
        axes = jnp.where(jnp.isnan(told[..., 3:]), axes, told[..., 3:])
        lengths = jnp.linalg.norm(axes, axis=-1, keepdims=True)
        changed = {
            "positions": positions,
            "axes": axes / jnp.maximum(lengths, np.finfo(np.float32).tiny),
            "obstacles": obstacles,
        }
        same = {
            name: jnp.broadcast_to(value, (PREVIEW, *np.shape(value)))
            for name, value in goal._asdict().items()
        }
        return Goal(**(same | changed))  # type: ignore[arg-type]


def _rows(goal: Goal) -> Float[Array, "rows 3"]:
    values = goal.positions, goal.axes, goal.obstacles
    return jnp.concatenate([jnp.asarray(value, jnp.float32) for value in values])
