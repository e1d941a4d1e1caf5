"""Warning of a poor fit that no single change of the map explains."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.cable_search import identify_cables
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.map_diagnosis import CLEARLY, POOR, Given, missed_share, rms_motion
from s2c2a.logs.take import LogTake, effective_drives
from s2c2a.spaces import POSITION

OTHER = {True: "sent", False: "settled"}  # `rows.commands` by whether rows are settled


def describe_poor_fit(
    takes: Sequence[LogTake],
    log_map: LogMap,
    given: Given,
    start: CableParameters,
) -> str:
    """Sentence on what the model misses and what to check; empty for a good fit.

    Args:
        takes: takes of the rows that the fit explains.
        log_map: the map.
        given: fit of the map as given.
        start: first guess, from which another fit begins.
    """
    ends = given.observations.states[:, log_map.end_modules, POSITION]
    share = given.residual / rms_motion(ends)
    if not share > POOR:
        return ""
    missed = f"the model misses {100 * share:.0f} % of the motion"
    other = OTHER[log_map.rows.settled]
    other_share = _share_of_other_commands(takes, log_map, given, start)
    if other_share < CLEARLY * share:
        return (
            f'{missed}; with rows.commands = "{other}" in the map it misses '
            f"{100 * other_share:.0f} % (nothing was changed)"
        )
    tried = ""
    if np.isfinite(other_share):
        tried = f' rows.commands ("{other}" does not fit clearly better),'
    return (
        f"{missed}, and no single change of the map explains it; check offset, unit, "
        f"and positive of the drives,{tried} and whether the log is fast: the model "
        "has no dynamics and no hysteresis"
    )


def _share_of_other_commands(
    takes: Sequence[LogTake],
    log_map: LogMap,
    given: Given,
    start: CableParameters,
) -> float:
    """Share of the motion that a fit misses with commands shifted by a row."""
    rows = log_map.rows.model_copy(update={"commands": OTHER[log_map.rows.settled]})
    shifted = log_map.model_copy(update={"rows": rows})
    columns = np.concatenate([effective_drives(each, shifted) for each in takes])
    if np.array_equal(columns, given.observations.columns):
        return np.inf  # drives are measured
    observations = replace(given.observations, columns=columns)
    try:
        # a poor fit is no start for another
        fit, _, _ = identify_cables(observations, start, shifted)
    except S2C2AError:
        return np.inf
    return missed_share(fit, observations)
