"""Rests of drives whose numbers count from elsewhere, such as servos around 90 deg."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from s2c2a.logs.log_map import LogMap
from s2c2a.logs.registration import MIN_ROWS, straight_rows
from s2c2a.logs.take import Drives, Ends, LogTake, effective_drives

FAR = 0.5
"""Distance of zero from the values of a drive, over their range, from which zero is no
rest: cables that only pull begin near theirs."""
DOUBTFUL = 0.2
"""Distance of zero from the value where the arm is straightest, over the range, from
which both are tried as rests; in logs of four arms that count from rest, it is less."""


def possible_rests(
    takes: Sequence[LogTake], log_map: LogMap
) -> list[Float[np.ndarray, " drives"]]:
    """Values of the drives at rest that a log allows: zero, or where it is straightest.

    It is zero for drives with a stated offset, and for forces.

    Raises:
        LogError: the outermost end is measured in too few rows.
    """
    zero = np.zeros(len(log_map.drives))
    is_free = ["offset" not in drive.model_fields_set for drive in log_map.drives]
    if log_map.by_force or not any(is_free):
        return [zero]
    values = np.concatenate([effective_drives(take, log_map) for take in takes])
    if len(values) < MIN_ROWS:
        return [zero]
    positions = np.concatenate([take.positions for take in takes])
    low = np.nanmin(values, axis=0)
    high = np.nanmax(values, axis=0)
    straight = _values_where_straight(values, positions, log_map)
    straight = np.where(is_free, straight, 0.0)
    motion = high - low
    is_far = np.maximum(low, -high) > FAR * motion
    if (is_free & is_far & (motion > 0.0)).any():
        return [straight]
    if (np.abs(straight) > DOUBTFUL * motion).any():
        return [zero, straight]
    return [zero]


def _values_where_straight(
    values: Drives,
    positions: Ends,
    log_map: LogMap,
) -> Float[np.ndarray, " drives"]:
    """Regression of the drives on the ends, where these are if the arm is straight.

    Few rows show the arm straight, and their drives scatter.
    """
    is_straight = straight_rows(positions, log_map)
    rest = np.nanmedian(positions[is_straight], axis=0)
    ends = (positions - rest).reshape(len(positions), -1)
    ends = ends[:, np.isfinite(rest).ravel()]
    known = np.isfinite(ends).all(axis=1)
    known &= np.isfinite(values).all(axis=1)
    features = np.column_stack([np.ones(known.sum()), ends[known]])
    return np.linalg.lstsq(features, values[known])[0][0]


def from_rests(take: LogTake, rests: Float[np.ndarray, " drives"]) -> LogTake:
    """Take whose drives count from their rest."""
    return replace(
        take, commanded=take.commanded - rests, measured=take.measured - rests
    )
