"""Warning of a poor fit that no single change of the map explains."""

from s2c2a.logs.log_map import LogMap
from s2c2a.logs.map_diagnosis import POOR


def describe_poor_fit(missed: float, log_map: LogMap) -> str:
    """Sentence on what to check; empty for a good fit.

    Args:
        missed: share of the motion that the fit misses.
        log_map: the map.
    """
    if not missed > POOR:
        return ""
    tried = ""
    if any(drive.measured is None for drive in log_map.drives):
        tried = " rows.commands (the other one does not fit clearly better),"
    return (
        f"the model misses {100 * missed:.0f} % of the motion, and no single change of "
        "the map explains it; check offset, unit, and positive of the drives,"
        f"{tried} and whether the log is fast: the model has no dynamics and no "
        "hysteresis"
    )
