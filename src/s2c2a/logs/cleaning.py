"""Exclusion of poses that cannot be true, before anything is identified from a log."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.take import LogTake, effective_drives
from s2c2a.measurements.outliers import MAX_SHARE, MeasuredEnds, Outliers, find_outliers

SHOWN = 3  # rows that the summary names


@dataclass(frozen=True)
class Excluded:
    """Poses that are excluded from logs.

    Attributes:
        ends: all poses as they were measured, of all logs in a row.
        modules: module of each end, from the base outward.
        outliers: which of the poses are excluded; None if all are kept.
        rows: the first rows with an excluded pose, in words; they count from 0 below
            the header.
    """

    ends: MeasuredEnds = field(compare=False)
    modules: tuple[int, ...]
    outliers: Outliers | None = field(default=None, compare=False)
    rows: str = ""

    def __str__(self) -> str:
        """One sentence; empty if nothing is excluded."""
        found = self.outliers
        if found is None or not found.count:
            return ""
        return (
            f"excluded {found.count} of {found.measured.sum()} poses: {found.kinds}; "
            f"first in rows {self.rows} (docs/guides/import.md)"
        )


def exclude_outliers(
    takes: Sequence[LogTake], log_map: LogMap
) -> tuple[list[LogTake], Excluded]:
    """Replace poses that cannot be true by NaN; the drives stay.

    Args:
        takes: rows of all logs, as they were recorded.
        log_map: the map.

    Raises:
        LogError: more than `MAX_SHARE` of the poses of an end cannot be true.
    """
    order = np.argsort(log_map.end_modules)
    modules = tuple(np.array(log_map.end_modules)[order].tolist())
    lengths = [len(take) for take in takes]
    drives = [effective_drives(take, log_map) for take in takes]
    positions = [take.positions[:, order] for take in takes]
    axes = [take.axes[:, order] for take in takes]
    ends = MeasuredEnds(
        np.concatenate(drives),
        np.concatenate(positions),
        np.concatenate(axes),
        np.repeat(np.arange(len(takes)), lengths),
    )
    if log_map.rows.outliers == "keep":
        return list(takes), Excluded(ends, modules)
    found = find_outliers(ends, _reaches(log_map, order))
    rows = _describe_rows(found, takes, log_map)
    if found.is_excessive:
        raise LogError(_describe_excess(found, modules, rows))
    is_excluded = np.empty_like(found.all)
    is_excluded[:, order] = found.all
    borders = np.cumsum([len(take) for take in takes])[:-1]
    parts = np.split(is_excluded, borders)
    cleaned = []
    for take, part in zip(takes, parts, strict=True):
        known = np.where(part[..., None], np.nan, 1.0)
        places = known * take.positions
        cleaned.append(replace(take, positions=places, axes=known * take.axes))
    return cleaned, Excluded(ends, modules, found, rows)


def _reaches(log_map: LogMap, order: np.ndarray) -> list[float | None]:
    """Length of the arm between each end and the one before it [m], if it is stated."""
    ends = np.array(log_map.end_modules)[order]
    lengths = log_map.arm.lengths
    if lengths is None and log_map.arm.modules == 1 and log_map.arm.length:
        lengths = (log_map.arm.length,)
    if lengths is None:
        return [None] * len(ends)
    heights = np.cumsum(lengths)[ends]
    return [None, *np.diff(heights)]


def _describe_rows(
    found: Outliers,
    takes: Sequence[LogTake],
    log_map: LogMap,
) -> str:
    """The first rows with an outlier, with the number of their log if there are more."""
    rows = np.flatnonzero(found.all.any(axis=1))[:SHOWN]
    starts = np.cumsum([0, *(len(take) for take in takes)])
    logs = np.searchsorted(starts, rows, side="right") - 1
    numbers = rows - starts[logs] + log_map.rows.first_row
    if len(takes) == 1:
        return ", ".join(str(number) for number in numbers)
    pairs = zip(numbers, logs, strict=True)
    return ", ".join(f"{number} of log {log + 1}" for number, log in pairs)


def _describe_excess(
    found: Outliers,
    modules: tuple[int, ...],
    rows: str,
) -> str:
    worst = int(np.argmax(found.shares))
    return (
        f"{100 * found.shares[worst]:.0f} % of the poses of the end of module "
        f"{modules[worst] + 1} cannot be true ({found.kinds}; first in rows {rows}), and at "
        f"most {100 * MAX_SHARE:.0f} % are excluded; check the columns and units of the "
        'ends, and the tracking of these rows, or set outliers = "keep" in [rows] to '
        "import them as they are"
    )
