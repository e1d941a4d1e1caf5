"""What is asked of the next state: targets, obstacles, weights. Always of one size, so that nothing compiles anew."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from s2c2a.errors import TargetError

MOST_OBSTACLES = 8
Numbers = Array | np.ndarray  # NumPy outside the planner, traced inside


class Goal(NamedTuple):
    """A goal for one control step; build it with `Goal.of`, change it with `with_...`.

    Attributes:
        positions: wanted module ends [m], base frame, shape (modules, 3).
        position_weights: mu_p of every module; zero where nothing is asked, shape (modules,).
        axes: wanted end axes, base frame, shape (modules, 3).
        axis_weights: mu_o of every module, shape (modules,).
        obstacles: centres [m], base frame, shape (MOST_OBSTACLES, 3).
        thresholds: r of every obstacle [m]; zero where there is none, shape (MOST_OBSTACLES,).
        obstacle_weight: mu_ob.
        change_weight: mu_d.
    """

    positions: Float[Numbers, "modules 3"]
    position_weights: Float[Numbers, " modules"]
    axes: Float[Numbers, "modules 3"]
    axis_weights: Float[Numbers, " modules"]
    obstacles: Float[Numbers, "obstacles 3"]
    thresholds: Float[Numbers, " obstacles"]
    obstacle_weight: Float[Numbers, ""]
    change_weight: Float[Numbers, ""]

    @classmethod
    def of(cls, modules: int, change_weight: float = 0.5) -> "Goal":
        """A goal that asks for nothing but little change (mu_d)."""
        return cls(
            positions=np.zeros((modules, 3), np.float32),
            position_weights=np.zeros(modules, np.float32),
            axes=np.tile(np.array([0, 0, 1], np.float32), (modules, 1)),
            axis_weights=np.zeros(modules, np.float32),
            obstacles=np.zeros((MOST_OBSTACLES, 3), np.float32),
            thresholds=np.zeros(MOST_OBSTACLES, np.float32),
            obstacle_weight=np.array(1.0, np.float32),
            change_weight=np.array(change_weight, np.float32),
        )

    def with_position(self, position, weight: float = 1.0, module: int = -1) -> "Goal":
        """Also ask for a module's end position [m], base frame.

        Raises:
            TargetError: not three finite numbers.
        """
        return self._replace(
            positions=_put(self.positions, module, _vector(position, "target position")),
            position_weights=_put(self.position_weights, module, weight),
        )

    def with_axis(self, axis, weight: float = 2.0, module: int = -1) -> "Goal":
        """Also ask for a module's end axis, base frame, of any length.

        Raises:
            TargetError: not three finite numbers, or all zero.
        """
        vector = _vector(axis, "target axis")
        length = np.linalg.norm(vector)
        if length < 1e-9:
            raise TargetError("the target axis is zero; give a direction such as [0, 0, 1]")
        return self._replace(
            axes=_put(self.axes, module, vector / length),
            axis_weights=_put(self.axis_weights, module, weight),
        )

    def with_obstacles(self, centres, thresholds, weight: float = 1.0) -> "Goal":
        """Replace the obstacles: centres [m], base frame, shape (n, 3), and thresholds r [m], shape (n,).

        Raises:
            TargetError: too many, or not finite numbers of these shapes.
        """
        centres, thresholds = np.asarray(centres, np.float32), np.asarray(thresholds, np.float32)
        count = len(thresholds)
        if centres.shape != (count, 3) or count > MOST_OBSTACLES:
            raise TargetError(
                f"obstacles of shape {centres.shape} with {count} thresholds; give (n, 3) centres and n thresholds, "
                f"n at most {MOST_OBSTACLES}"
            )
        if not (np.isfinite(centres).all() and np.isfinite(thresholds).all()):
            raise TargetError(f"obstacles must be finite, got centres {centres.tolist()}, r {thresholds.tolist()}")
        goal = Goal.of(len(self.positions))
        return self._replace(
            obstacles=np.concatenate([centres, goal.obstacles[count:]]),
            thresholds=np.concatenate([thresholds, goal.thresholds[count:]]),
            obstacle_weight=np.array(weight, np.float32),
        )


def _vector(values, name: str) -> Float[np.ndarray, "3"]:
    vector = np.asarray(values, np.float32)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise TargetError(f"the {name} must be three finite numbers, got {values}; the arm was not moved")
    return vector


def _put(values: Numbers, place: int, value) -> np.ndarray:
    changed = np.array(values)
    changed[place] = value
    return changed
