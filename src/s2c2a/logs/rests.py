"""Rest of drives whose numbers count from elsewhere, such as servos around 90 deg."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from s2c2a.logs.log_map import LogMap
from s2c2a.logs.registration import straight_rows
from s2c2a.logs.take import LogTake, effective_drives

FAR = 0.5
"""Distance of zero from the values of a drive, over their range, from which zero is no
rest: cables that only pull begin near theirs."""


def estimate_rests(
    takes: Sequence[LogTake], log_map: LogMap
) -> Float[np.ndarray, " drives"]:
    """Value of each drive where the arm is straightest, where zero cannot be its rest.

    It is zero for drives with a stated offset, and for forces.

    Raises:
        LogError: the outermost end is measured in too few rows.
    """
    values = np.concatenate([effective_drives(take, log_map) for take in takes])
    low = np.nanmin(values, axis=0)
    high = np.nanmax(values, axis=0)
    travel = high - low
    distance = np.maximum(low, -high)
    is_far = (travel > 0.0) & (distance > FAR * travel)
    for index, drive in enumerate(log_map.drives):
        is_far[index] &= "offset" not in drive.model_fields_set
    if log_map.by_force or not is_far.any():
        return np.zeros(len(log_map.drives))
    positions = np.concatenate([take.positions for take in takes])
    is_straight = straight_rows(positions, log_map)
    return np.where(is_far, np.nanmedian(values[is_straight], axis=0), 0.0)


def from_rests(take: LogTake, rests: Float[np.ndarray, " drives"]) -> LogTake:
    """Take whose drives count from their rest."""
    return replace(
        take, commanded=take.commanded - rests, measured=take.measured - rests
    )
