"""Border to robots, controllers and goals, which may be a user's own: errors name them."""

import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, TargetError
from s2c2a.goals import Goal
from s2c2a.obstacles import distances

MAX_DISTANCE = 10.0  # arm lengths from the base; beyond, the unit must be wrong

LIBRARIES = (
    Path(__file__).parents[1],
    *(Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib")),
)
"""Folders of code that is not the user's: the package, Python and what is installed."""


@contextmanager
def named_errors(error_type: type[S2C2AError], action: str) -> Iterator[None]:
    """Turn any foreign exception into an error of the package.

    Args:
        error_type: of the error; the exception is its cause.
        action: what failed, such as `Puppet.send failed in step 3`.

    Raises:
        S2C2AError: the block raised an exception; the package's own are not changed.
    """
    try:
        yield
    except S2C2AError:
        raise
    except Exception as error:
        raise error_type(f"{action}: {described(error)}") from error


def attribute(part: Any, name: str, error_type: type[S2C2AError], *default: Any) -> Any:
    """Return an attribute of a user's object, whose property may fail.

    Args:
        part: the object.
        name: of the attribute.
        error_type: of the error.
        default: is returned where there is no such attribute.

    Raises:
        S2C2AError: it cannot be read; the error names class and attribute.
    """
    with named_errors(error_type, f"{type(part).__name__}.{name} failed"):
        return getattr(part, name, *default)


def described(error: Exception) -> str:
    """Return type, text, and place in a user's own code of a foreign exception."""
    text = f"{type(error).__name__}: {error}"
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        file = Path(frame.filename)
        if file.is_file() and not any(map(file.is_relative_to, LIBRARIES)):
            return f"{text} ({file.name}, line {frame.lineno})"
    return text


def check_goal(goal: Goal, arm: ArmSpec) -> None:
    """Refuse a goal that is none for an arm.

    Raises:
        TargetError: it is no goal, has an array of another shape, as with another number
            of modules, or is not in meters.
    """
    shapes = _shapes(arm.module_count)
    for (name, shape), value in zip(shapes.items(), Goal.checked(goal), strict=True):
        if np.shape(value) != shape:
            raise TargetError(
                f"the goal has {name} of shape {np.shape(value)}, and '{arm.name}' of "
                f"{shape}; begin with Goal.of({arm.module_count})"
            )
    check_meters(goal.positions, arm, "the goal")
    check_meters(np.nan_to_num(goal.preview[..., :3]), arm, "the preview of the goal")
    radii = goal.thresholds
    if radii.any():
        gaps = distances(np.zeros(3), goal.obstacles, goal.cores) - radii
        # obstacles may be far away, and large ones walls of what is near
        check_meters(
            np.minimum(radii, np.abs(gaps)), arm, "an obstacle, by its radius,"
        )


@cache
def _shapes(modules: int) -> dict[str, tuple[int, ...]]:
    """Shapes of a goal's arrays, by name."""
    return {name: np.shape(value) for name, value in Goal.of(modules)._asdict().items()}


def check_meters(positions: np.ndarray, arm: ArmSpec, name: str) -> None:
    """Refuse positions so far from the base that they cannot be in meters.

    Raises:
        TargetError: one is.
    """
    farthest = np.abs(positions).max()
    if not farthest <= MAX_DISTANCE * arm.length:
        raise TargetError(
            f"{name} has a coordinate of {farthest:.3g} m, and '{arm.name}' reaches at "
            f"most {arm.length:.3g} m; write lengths in meters: 0.1, not 100, from the base"
        )
