"""Other readings of the ends' rotations, under which their axes follow the motion.

An arm that is identified from positions alone predicts the axes.
"""

from collections.abc import Iterator, Sequence
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.logs.cable_model import states_in_log
from s2c2a.logs.log_map import End, LogMap
from s2c2a.logs.map_changes import AXES
from s2c2a.logs.map_diagnosis import CLEARLY
from s2c2a.logs.model_fit import CableFit, predict_states
from s2c2a.logs.take import LogTake, effective_drives

ROTATIONS = ("axis", "quaternion", "order", "matrix", "euler", "sequence")


def without_rotations(log_map: LogMap) -> LogMap:
    """Map of the positions alone."""
    blank = dict.fromkeys(ROTATIONS)
    ends = tuple(end.model_copy(update=blank) for end in log_map.ends)
    return log_map.model_copy(update={"ends": ends})


def other_readings(ends: Sequence[End]) -> Iterator[tuple[str, tuple[End, ...]]]:
    """Changes of how the map reads the rotations of all ends, and the changed ends."""
    turned = [any(getattr(end, name) for name in ROTATIONS) for end in ends]
    changes = [
        _changes(end) if has_axes else {}
        for end, has_axes in zip(ends, turned, strict=True)
    ]
    for clause in dict.fromkeys(clause for each in changes for clause in each):
        applies = [clause in each for each in changes]
        if applies == turned:
            yield (
                clause,
                tuple(
                    each.get(clause, end)
                    for end, each in zip(ends, changes, strict=True)
                ),
            )


def _changes(end: End) -> dict[str, End]:
    """Single changes of how the map reads an end's rotation, and the changed end."""
    changes: list[dict[str, object]] = []
    if end.quaternion:
        changes.append({"order": "wxyz" if end.order == "xyzw" else "xyzw"})
    if end.matrix:
        columns = [end.matrix[place] for place in (0, 3, 6, 1, 4, 7, 2, 5, 8)]
        changes.append({"matrix": tuple(columns)})
    if end.euler:
        changes.append({"euler_unit": "rad" if end.euler_unit == "deg" else "deg"})
    if end.euler and len(end.euler) == 3:
        orders = ["".join(order) for order in permutations("xyz")]
        changes += [{"sequence": each} for each in orders]
        changes += [{"sequence": each.upper()} for each in orders]
    if not end.axis:
        changes += [{"along": axis} for axis in AXES]
    changed = {}
    for change in changes:
        ((key, value),) = change.items()
        text = list(value) if isinstance(value, tuple) else value
        clause = f"{key} = {text!r}".replace("'", '"')
        changed[clause] = end.model_copy(update=change)
    return changed


def describe_rotations(
    stated: Sequence[LogTake],
    others: Sequence[tuple[str, Sequence[LogTake]]],
    log_map: LogMap,
    axes: np.ndarray,
    fit: CableFit,
) -> str:
    """Sentence that names the change under which an end's axes follow the motion.

    Args:
        stated: takes, read as the map states.
        others: clauses of changes, and the takes read with them.
        log_map: the map.
        axes: axes of the untilted base frame as columns, frame of the log.
        fit: of the positions alone, to the drives of the takes.
    """
    columns = np.concatenate([effective_drives(take, log_map) for take in stated])
    _, states = predict_states(fit.parameters, fit.wiring, columns, log_map.by_force)
    with jax.enable_x64(True):
        located = states_in_log(fit.parameters, jnp.asarray(states), jnp.asarray(axes))
    predicted = np.asarray(located)[:, log_map.end_modules, 3:]

    def error_deg(takes: Sequence[LogTake]) -> float:
        measured = np.concatenate([take.axes for take in takes])
        squares = np.sum((measured - predicted) ** 2, axis=-1)
        has_axis = np.isfinite(squares).any(axis=0)
        means = np.nanmean(squares[:, has_axis], axis=0)
        return float(np.rad2deg(np.sqrt(means.max())))

    old = error_deg(stated)
    errors = [error_deg(takes) for _, takes in others]
    least = min(errors, default=old)
    if not least < CLEARLY * old:
        return (
            "the axes of the ends contradict their positions, and no other reading of "
            "them fits clearly better; leave them out of the map"
        )
    likely = [
        clause
        for (clause, _), error in zip(others, errors, strict=True)
        if round(error) == round(least)
    ]
    return (
        f"the map contradicts the log: write {' or '.join(likely)} for the ends; their "
        f"axes then follow their positions within {least:.0f} deg (rms), not {old:.0f} "
        "(nothing was changed)"
    )
