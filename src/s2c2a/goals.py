"""What is asked of the next state: targets, obstacles, weights. Always of one size, so that nothing compiles anew."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.errors import TargetError

MAX_OBSTACLES = 64
LARGEST = 1e6
"""A position [m], weight or threshold beyond it is a slip, and would not be a number
any more once it is squared."""
Numbers = np.ndarray  # inside the planner, the same fields are traced by JAX


class Goal(NamedTuple):
    """A goal for one control step; build it with `Goal.of`, change it with `with_...`.

    Attributes:
        positions: desired module ends [m], base frame, shape (modules, 3).
        position_weights: mu_p of every module; zero where nothing is asked, shape
            (modules,).
        axes: desired end axes, base frame, shape (modules, 3).
        axis_weights: mu_o of every module, shape (modules,).
        obstacles: centers [m], base frame, shape (MAX_OBSTACLES, 3).
        thresholds: r of every obstacle [m]; zero where there is none, shape
            (MAX_OBSTACLES,).
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
            obstacles=np.zeros((MAX_OBSTACLES, 3), np.float32),
            thresholds=np.zeros(MAX_OBSTACLES, np.float32),
            obstacle_weight=np.array(1.0, np.float32),
            change_weight=np.array(_weight(change_weight), np.float32),
        )

    def with_position(self, position, weight: float = 1.0, module: int = -1) -> "Goal":
        """Also ask for a module's end position [m], base frame.

        Raises:
            TargetError: not three finite numbers, a negative weight, or no such module.
        """
        vector = _vector(position, "the target position")
        mu = _weight(weight)
        return self._with_module(module, positions=vector, position_weights=mu)

    def with_axis(self, axis, weight: float = 2.0, module: int = -1) -> "Goal":
        """Also ask for a module's end axis, base frame, of any length.

        Raises:
            TargetError: not three finite numbers, all zero, a negative weight, or no
                such module.
        """
        vector = _vector(axis, "the target axis")
        mu = _weight(weight)
        length = np.linalg.norm(vector)
        if length < 1e-9:
            raise TargetError(
                "the target axis is zero; give a direction such as [0, 0, 1]"
            )
        return self._with_module(module, axes=vector / length, axis_weights=mu)

    @classmethod
    def stacked(cls, goals: Sequence["Goal"]) -> "Goal":
        """Many goals as one, every array with the number of goals in front.

        Raises:
            TargetError: none, or for arms of different numbers of modules.
        """
        if len({len(goal.positions) for goal in goals}) != 1:
            raise TargetError(
                "goals of one arm are needed, at least one; got none, or goals for different arms"
            )
        return cls(*(np.stack(parts) for parts in zip(*goals, strict=True)))

    def desired_positions(self) -> Float[np.ndarray, "*goals modules 3"]:
        """Desired module ends [m], base frame; NaN where nothing is asked."""
        return np.where(self.position_weights[..., None] > 0, self.positions, np.nan)

    def desired_axes(self) -> Float[np.ndarray, "*goals modules 3"]:
        """Desired end axes, base frame; NaN where nothing is asked."""
        return np.where(self.axis_weights[..., None] > 0, self.axes, np.nan)

    def obstacles_in_use(self) -> Float[np.ndarray, "*goals obstacles 4"]:
        """Centers and thresholds [m], base frame, of those that any goal has."""
        every = np.concatenate([self.obstacles, self.thresholds[..., None]], axis=-1)
        return every[..., self.thresholds.reshape(-1, MAX_OBSTACLES).max(axis=0) > 0, :]

    def _with_module(self, module: int, **values: np.ndarray) -> "Goal":
        """The same with other values of one module, by field."""
        count = len(self.positions)
        if not isinstance(module, int | np.integer) or not -count <= module < count:
            raise TargetError(
                f"no module {module}; this goal is for {count}, from 0 at the base to {count - 1}, or -1"
            )
        changed = {name: np.array(getattr(self, name)) for name in values}
        for name, value in values.items():
            changed[name][module] = value
        return self._replace(**changed)

    def with_obstacles(self, centers, thresholds, weight: float = 1.0) -> "Goal":
        """Replace the obstacles: centers [m], base frame, shape (n, 3), and thresholds r [m], shape (n,).

        Raises:
            TargetError: too many, or not finite numbers of these shapes.
        """
        centers = _numbers(centers, "obstacles")
        thresholds = _numbers(thresholds, "thresholds of obstacles")
        count = thresholds.size
        if (
            thresholds.shape != (count,)
            or centers.shape not in ((count, 3), (0,))
            or count > MAX_OBSTACLES
        ):
            raise TargetError(
                f"obstacles of shape {centers.shape} with thresholds of shape {thresholds.shape}; give (n, 3) centers "
                f"and n thresholds, n at most {MAX_OBSTACLES}"
            )
        if (thresholds < 0).any():
            raise TargetError(
                f"obstacle thresholds are lengths and must not be negative, got {thresholds.tolist()}"
            )
        goal = Goal.of(len(self.positions))
        return self._replace(
            obstacles=np.concatenate([centers.reshape(-1, 3), goal.obstacles[count:]]),
            thresholds=np.concatenate([thresholds, goal.thresholds[count:]]),
            obstacle_weight=np.array(_weight(weight), np.float32),
        )


def _numbers(
    values,
    name: str,
    kind: str = "finite numbers",
    shape: tuple[int, ...] | None = None,
) -> np.ndarray:
    """As single precision, of one shape if it is given."""
    try:
        with np.errstate(over="ignore"):
            numbers = np.asarray(values, np.float32)
        if (np.abs(numbers) <= LARGEST).all() and shape in (None, numbers.shape):
            return numbers
    except (TypeError, ValueError, OverflowError):
        pass  # told as all others
    raise TargetError(
        f"{name} must be {kind} of at most {LARGEST:g}, got {_shown(values)}; the arm was not moved"
    )


def _vector(values, name: str) -> Float[np.ndarray, "3"]:
    return _numbers(values, name, "three finite numbers", (3,))


def _shown(values) -> str:
    try:
        return f"{values!r:.200}"
    except ValueError:  # a whole number of thousands of digits
        return "something too long to show"


def _weight(value) -> np.ndarray:
    weight = _numbers(value, "a weight", "one number", ())
    if weight < 0:
        raise TargetError(
            f"a weight must be one number and not negative, got {_shown(value)}"
        )
    return weight
