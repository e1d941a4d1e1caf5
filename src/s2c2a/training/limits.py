"""Numbers that options may have."""

from typing import Any

from s2c2a.errors import S2C2AError, TrainingError

MOST_VALUES = 100
"""Of one option that has several."""


def check_limits(options: Any, error: type[S2C2AError] = TrainingError, **limits: tuple[float, float]) -> None:
    """Refuse options of which a number is out of its limits, or no number.

    Args:
        options: with an attribute for every limit: a number or a tuple of them.
        error: what to raise.
        limits: least and largest value of each.

    Raises:
        S2C2AError: of the kind that is asked for.
    """
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        values = value if isinstance(value, tuple) else (value,)
        if len(values) > MOST_VALUES:
            raise error(f"{len(values)} values of {name} were asked for; take {MOST_VALUES} at most")
        if not all(low <= one <= high for one in values):  # NaN is neither
            raise error(f"{name} = {value} was asked for; take {low:g} to {high:g}")
