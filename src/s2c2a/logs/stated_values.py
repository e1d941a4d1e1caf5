"""Stated values that a log contradicts: the fit stays within their bounds."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.map_changes import AXES
from s2c2a.logs.model_fit import Observations

AT_BOUND = 0.95  # share of the largest deviation; a fit ends just inside


def describe_contradictions(
    parameters: CableParameters, observations: Observations
) -> str:
    """Sentence that names the stated values at whose bounds a fit ends; may be empty.

    Args:
        parameters: fitted parameters.
        observations: bounds of stated values, and the axes of the frame.
    """
    clauses = [
        clause
        for name, (stated, deviation) in observations.bounds.items()
        for clause in _clauses(
            name, _share(name, parameters, stated, deviation), observations.axes
        )
    ]
    if not clauses:
        return ""
    return (
        f"the log contradicts stated values: it fits better with {', '.join(clauses)}; "
        "they are kept: measure them again, or leave them out of the map (an error "
        "of one can show at another)"
    )


def _share(
    name: str, parameters: CableParameters, stated: np.ndarray, deviation: float
) -> np.ndarray:
    """Deviations from stated values over the largest ones."""
    if name == "total":
        value = np.log(np.sum(np.exp(parameters.lengths)))
    else:
        value = getattr(parameters, name)
    return np.atleast_1d((value - stated) / deviation)


def _clauses(
    name: str, shares: np.ndarray, axes: Float[np.ndarray, "3 3"]
) -> Iterator[str]:
    at_bound = np.where(np.abs(shares) >= AT_BOUND, np.sign(shares), 0.0)
    if not at_bound.any():
        return
    if name == "tilt":
        yield f"frame.along turned towards {_direction(at_bound, axes)}"
        return
    for place, sign in enumerate(at_bound):
        if not sign:
            continue
        size = "larger" if sign > 0 else "smaller"
        texts = {
            "base": f"a {size} {'xyz'[place]} of frame.base",
            "lengths": f"a {size} number {place} of arm.lengths",
            "total": f"a {size} arm.length",
        }
        yield texts[name]


def _direction(tilt: Float[np.ndarray, "2"], axes: Float[np.ndarray, "3 3"]) -> str:
    """Axis of the log towards which rotations about x and y turn z."""
    towards = axes[:, :2] @ np.array([tilt[1], -tilt[0]])
    return AXES[int(np.argmax([*towards, *-towards]))]
