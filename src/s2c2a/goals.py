"""Goals of a control step: targets, obstacles, weights.

All goals have the same array shapes, so that a new goal causes no compilation.
"""

import warnings
from collections.abc import Collection, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from s2c2a.errors import StrategyError, TargetError, did_you_mean
from s2c2a.files.text import LARGEST
from s2c2a.plugins.immutable import immutable
from s2c2a.printing import short_text

PREVIEW = 12  # moments of a preview: 1.2 s, about a period of a slow soft arm
PREVIEW_INTERVAL = 0.1  # s between them; a control step where that is longer
START_TIME = 1.0  # s; chosen: until a plan beside obstacles is at its full pace
MAX_OBSTACLES = 64  # benchmarks/bench_growth.py measures what they cost
Numbers = np.ndarray  # inside the planner, JAX traces the same fields
# attributes of strategies and controllers that need not be there
STATED = ("ignores", "supports", "recipe_keys", "set_real_time")
MISSPELLED = 0.8  # similarity of names; letters of `ingores` in their order have 0.86
GoalPart = Literal["axes", "other ends", "obstacles"]
"""Parts of goals beside the position of the tip; "other ends" than that of the tip."""
Scalar = Float[Numbers, ""]
PerModule = Float[Numbers, " modules"]
Vectors = Float[Numbers, "modules 3"]


class Goal(NamedTuple):
    """A goal for one control step; build it with `Goal.of`, change it with `with_...`.

    Attributes:
        positions: desired module ends [m], base frame, shape (modules, 3).
        position_weights: mu_p of every module, zero without a desired position, shape
            (modules,).
        axes: desired end axes, base frame, shape (modules, 3).
        axis_weights: mu_o of every module, zero without a desired axis, shape
            (modules,).
        obstacles: centers [m], base frame, shape (MAX_OBSTACLES, 3).
        thresholds: r of every obstacle [m], zero for unused rows, shape
            (MAX_OBSTACLES,).
        cores: of every obstacle (`s2c2a.obstacles`), zeros for spheres, shape
            (MAX_OBSTACLES, 8).
        obstacle_weight: mu_ob.
        change_weight: mu_d.
        preview: positions [m] and axes of the goals of the next moments, shape
            (PREVIEW, modules, 6); NaN where they are not known (`previewed`).
        shape: desired bends of all modules [rad], shape (modules, 2), module frames.
        shape_weight: of these bends; zero if no shape is desired.
    """

    positions: Vectors
    position_weights: PerModule
    axes: Vectors
    axis_weights: PerModule
    obstacles: Float[Numbers, "obstacles 3"]
    thresholds: Float[Numbers, " obstacles"]
    cores: Float[Numbers, "obstacles 8"]
    obstacle_weight: Scalar
    change_weight: Scalar
    preview: Float[Numbers, "moments modules 6"]
    shape: Float[Numbers, "modules 2"]
    shape_weight: Scalar

    def __repr__(self) -> str:
        """Fields, and shapes of arrays."""
        return short_text(self)

    @classmethod
    def of(cls, modules: int, change_weight: float = 0.5) -> "Goal":
        """Create a goal without targets; only changes have a cost (mu_d).

        Raises:
            TargetError: the number of modules is none, or the weight is negative.
        """
        if not isinstance(modules, int | np.integer) or modules < 1:
            raise TargetError(
                "a goal needs the number of modules, at least 1, "
                f"got {_format(modules)}; write Goal.of(arm.module_count)"
            )
        return cls(
            positions=np.zeros((modules, 3), np.float32),
            position_weights=np.zeros(modules, np.float32),
            axes=np.tile(np.array([0, 0, 1], np.float32), (modules, 1)),
            axis_weights=np.zeros(modules, np.float32),
            obstacles=np.zeros((MAX_OBSTACLES, 3), np.float32),
            thresholds=np.zeros(MAX_OBSTACLES, np.float32),
            cores=np.zeros((MAX_OBSTACLES, 8), np.float32),
            obstacle_weight=np.array(1.0, np.float32),
            change_weight=_weight(change_weight),
            preview=np.full((PREVIEW, modules, 6), np.nan, np.float32),
            shape=np.zeros((modules, 2), np.float32),
            shape_weight=np.array(0.0, np.float32),
        ).frozen()

    def with_position(self, position, weight: float = 1.0, module: int = -1) -> "Goal":
        """Add a desired end position of a module [m], base frame.

        Raises:
            TargetError: the position is not three finite numbers, the weight is
                negative, or there is no such module.
        """
        vector = _vector(position, "the target position")
        mu = _weight(weight)
        return self._with_module(module, positions=vector, position_weights=mu)

    def with_axis(self, axis, weight: float = 2.0, module: int = -1) -> "Goal":
        """Add a desired end axis of a module, base frame, of any non-zero length.

        Raises:
            TargetError: the axis is not three finite numbers or is zero, the weight is
                negative, or there is no such module.
        """
        vector = _vector(axis, "the target axis")
        mu = _weight(weight)
        length = np.linalg.norm(vector)
        if length == 0:
            raise TargetError(
                "the target axis is zero; give a direction such as [0, 0, 1]"
            )
        return self._with_module(module, axes=vector / length, axis_weights=mu)

    @classmethod
    def stacked(cls, goals: Sequence["Goal"]) -> "Goal":
        """Stack goals: every array gets the number of goals as its first axis.

        Raises:
            TargetError: there is no goal, or goals have different numbers of modules.
        """
        if len({len(goal.positions) for goal in goals}) != 1:
            raise TargetError(
                "goals of one arm are needed, at least one; got none, "
                "or goals for different arms"
            )
        return cls(*map(np.stack, zip(*goals, strict=True)))

    @property
    def parts(self) -> frozenset[GoalPart]:
        """Parts beside the position of the tip that are desired; of stacked goals, any."""
        weights: dict[GoalPart, np.ndarray] = {
            "axes": self.axis_weights,
            "other ends": self.position_weights[..., :-1],
            "obstacles": self.thresholds,
        }
        return frozenset(part for part, sizes in weights.items() if sizes.any())

    @property
    def has_target(self) -> Bool[Numbers, "*goals"]:
        """Whether a position or an axis of any module is desired."""
        return (self.position_weights + self.axis_weights > 0.0).any(axis=-1)

    def desired_positions(self) -> Float[np.ndarray, "*goals modules 3"]:
        """Return the desired module ends [m], base frame; NaN for the others."""
        return np.where(self.position_weights[..., None] > 0, self.positions, np.nan)

    def desired_axes(self) -> Float[np.ndarray, "*goals modules 3"]:
        """Return the desired end axes, base frame; NaN for the others."""
        return np.where(self.axis_weights[..., None] > 0, self.axes, np.nan)

    def obstacles_in_use(self) -> Float[np.ndarray, "*goals obstacles 12"]:
        """Return the obstacles that any goal uses, as rows (`s2c2a.obstacles`)."""
        rows = np.concatenate(
            [self.obstacles, self.thresholds[..., None], self.cores], axis=-1
        )
        used = self.thresholds.reshape(-1, MAX_OBSTACLES).max(axis=0) > 0
        return rows[..., used, :]

    def with_rows(self, rows: Int[Any, " rows"] | slice) -> "Goal":
        """Return the goal, or stacked goals, with these rows of obstacles alone."""
        return self._replace(
            obstacles=self.obstacles[..., rows, :],
            thresholds=self.thresholds[..., rows],
            cores=self.cores[..., rows, :],
        )

    def _with_module(self, module: int, **values: np.ndarray) -> "Goal":
        """Replace the values of one module, by field."""
        count = len(self.positions)
        if not isinstance(module, int | np.integer) or not -count <= module < count:
            raise TargetError(
                f"no module {module}; this goal is for {count}, from 0 at the base to "
                f"{count - 1}, or -1"
            )
        fields = {}
        for name, value in values.items():
            fields[name] = np.array(getattr(self, name))
            fields[name][module] = value
        return self._replace(**fields).frozen()

    @staticmethod
    def checked(value: Any) -> "Goal":
        """Return a goal.

        Raises:
            TargetError: it is something else, such as a position.
        """
        if not isinstance(value, Goal):
            raise TargetError(
                f"a goal is needed, got {_format(value)}; build one, for 3 modules with "
                "Goal.of(3).with_position([0.1, 0, 0.5])"
            )
        return value

    def frozen(self) -> "Goal":
        """Return a copy of the goal with arrays that nobody can change."""
        values = [
            immutable(value) if isinstance(value, np.ndarray) else value
            for value in self
        ]
        return Goal(*values)

    def with_obstacles(
        self, centers, thresholds, weight: float = 1.0, cores=None
    ) -> "Goal":
        """Replace the obstacles.

        Args:
            centers: [m], base frame, shape (n, 3).
            thresholds: r [m], shape (n,).
            weight: mu_ob.
            cores: see `s2c2a.obstacles`, shape (n, 8); spheres without.

        Raises:
            TargetError: too many obstacles, or no finite numbers of these shapes.
        """
        centers = _numbers(centers, "obstacles")
        thresholds = _numbers(thresholds, "thresholds of obstacles")
        count = thresholds.size
        shapes_fit = thresholds.ndim == 1 and centers.shape in ((count, 3), (0,))
        if not shapes_fit or count > MAX_OBSTACLES:
            raise TargetError(
                f"obstacles have shape {centers.shape} and thresholds shape "
                f"{thresholds.shape}; give (n, 3) centers and n thresholds, "
                f"n at most {MAX_OBSTACLES}"
            )
        if (thresholds < 0).any():
            raise TargetError(
                "obstacle thresholds are lengths and must not be negative, "
                f"got {thresholds.tolist()}"
            )
        unused = Goal.of(len(self.positions))
        cores = np.zeros((count, 8)) if cores is None else cores
        solids = _numbers(cores, "cores of obstacles", "numbers", (count, 8))
        return self._replace(
            obstacles=np.concatenate(
                [centers.reshape(-1, 3), unused.obstacles[count:]]
            ),
            thresholds=np.concatenate([thresholds, unused.thresholds[count:]]),
            cores=np.concatenate([solids, unused.cores[count:]]),
            obstacle_weight=_weight(weight),
        ).frozen()


def warn_of_ignored(name: str, ignored: frozenset[GoalPart]) -> None:
    """Warn of parts of goals that a strategy or a controller ignores, if there are any."""
    if ignored:
        parts = ", ".join(sorted(ignored))
        warnings.warn(f"{name} ignores what its goal has: {parts}", stacklevel=2)


def checked_parts(ignores: Any, owner: Any) -> frozenset[GoalPart]:
    """The parts of goals that a strategy or a controller states to ignore.

    Args:
        ignores: what it states.
        owner: that states it, for the message.

    Raises:
        StrategyError: it is no collection of these parts, or an attribute is misspelled,
            which nothing would read.
    """
    for name in {*dir(owner)} - {*STATED}:
        if meant := get_close_matches(name, STATED, n=1, cutoff=MISSPELLED):
            raise StrategyError(
                f"{type(owner).__name__} has `{name}`; did you mean `{meant[0]}`? "
                "Rename it, or choose a name that differs more"
            )
    known = sorted(get_args(GoalPart))
    likely = ""
    if isinstance(ignores, Collection) and not isinstance(ignores, str):
        wrong = [part for part in ignores if part not in known]
        if not wrong:
            return frozenset(ignores)
        likely = did_you_mean(str(wrong[0]), known)
    raise StrategyError(
        f"ignores = {ignores!r} in {type(owner).__name__}{likely}: write a frozenset of "
        f"{', '.join(known)}"
    )


def preview_stride(period: float) -> int:
    """Number of control steps between the moments of a preview.

    Args:
        period: of the control steps [s].
    """
    return max(1, round(PREVIEW_INTERVAL / period))


def previewed(
    goals: Sequence[Goal], period: float, farthest: float = np.inf
) -> Iterator[Goal]:
    """Goals that know those after them; the last goal lasts.

    A planner that looks ahead (`planning.Horizon`) otherwise assumes that a goal goes on
    as it moved.

    Args:
        goals: one for every control step.
        period: of the control steps [s].
        farthest: change of the way per control step [m]. Where a target changes it by
            more, it jumps; then goals know those before the jump alone, since an arm
            that goes there at once vibrates (`planning.motion`).
    """
    stacked = Goal.stacked(goals)
    targets = [stacked.desired_positions(), stacked.desired_axes()]
    known = np.concatenate(targets, axis=-1, dtype=np.float32)
    ways = np.diff(targets[0], axis=0)
    turns = np.linalg.norm(np.diff(ways, axis=0, prepend=ways[:1]), axis=-1)
    ends = np.append(np.flatnonzero((turns > farthest).any(axis=-1)), len(goals) - 1)
    later = preview_stride(period) * np.arange(1, PREVIEW + 1) - 1
    for number, goal in enumerate(goals):
        preview = known[np.minimum(number + later, ends[ends >= number][0])]
        yield goal._replace(preview=preview).frozen()


def _numbers(
    values,
    name: str,
    kind: str = "finite numbers",
    shape: tuple[int, ...] | None = None,
) -> np.ndarray:
    """Convert to single precision and check size and, if given, shape."""
    try:
        with np.errstate(over="ignore"):
            numbers = np.asarray(values, np.float32)
        if (np.abs(numbers) <= LARGEST).all() and shape in (None, numbers.shape):
            return numbers
    except (TypeError, ValueError, OverflowError):
        pass  # the error below covers these values, too
    raise TargetError(
        f"{name} must be {kind} of at most {LARGEST:g}, got {_format(values)}; "
        "the arm did not move"
    )


def _vector(values, name: str) -> Float[np.ndarray, "3"]:
    return _numbers(values, name, "three finite numbers", (3,))


def _weight(value) -> np.ndarray:
    weight = _numbers(value, "a weight", "one number", ())
    if weight < 0:
        raise TargetError(
            f"a weight must be one number and not negative, got {_format(value)}"
        )
    return weight


def _format(values) -> str:
    try:
        return f"{values!r:.200}"
    except ValueError:  # Python refuses to print an integer of thousands of digits
        return "a number too long to show"
