"""Border to robots, controllers and goals, which may be a user's own: errors name them."""

import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, TargetError, counted
from s2c2a.goals import Goal

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
        TargetError: it is for another number of modules, or not in meters.
    """
    count = len(goal.positions)
    if count != arm.module_count:
        raise TargetError(
            f"the goal is for {counted(count, 'module')}, and '{arm.name}' has "
            f"{arm.module_count}; begin with Goal.of({arm.module_count})"
        )
    check_meters(goal.positions, arm, "the goal")


def check_meters(positions: np.ndarray, arm: ArmSpec, name: str) -> None:
    """Refuse positions so far from the base that they cannot be in meters.

    Raises:
        TargetError: one is.
    """
    farthest = np.abs(positions).max()
    if not farthest <= MAX_DISTANCE * arm.length:
        raise TargetError(
            f"{name} has a coordinate of {farthest:.3g} m, and '{arm.name}' reaches at "
            f"most {arm.length:.3g} m; write positions in meters: 0.1, not 100, from the base"
        )
