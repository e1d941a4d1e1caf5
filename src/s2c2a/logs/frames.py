"""Where the base frame is in the frame of the file, from rest and motion: a first idea, for the fit to begin with."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.logs.errors import LogError
from s2c2a.logs.map import LogMap
from s2c2a.logs.session import direction

# share of all rows, those in which the tip is furthest along the arm, that show it
# straight
RESTING = 0.03
# tip's drop, times length, over the square of its way across, whichever module bends
ARC_DROP = 0.65


class Registration(NamedTuple):
    """A base frame.

    Attributes:
        axes: columns are its x, y, z in the frame of the file.
        base: its origin there [m].
        lengths: of the modules [m].
        rest: measured ends of the straight arm, frame of the file, shape (ends, 3).
    """

    axes: Float[np.ndarray, "3 3"]
    base: Float[np.ndarray, "3"]
    lengths: Float[np.ndarray, " modules"]
    rest: Float[np.ndarray, "ends 3"]


def first_registration(
    positions: Float[np.ndarray, "rows ends 3"], told: LogMap
) -> Registration:
    """The base frame as the map says it, and what it leaves out as rest and motion suggest.

    Args:
        positions: of the ends [m], frame of the file; NaN where they were not seen.
        told: the map.

    Raises:
        LogError: the outermost end was hardly seen.
    """
    order = np.argsort(told.end_modules)
    tip = positions[:, order[-1]]
    seen = np.isfinite(tip).all(axis=1)
    if seen.sum() < 10:
        raise LogError(
            f"the end of module {max(told.end_modules)} was seen in {seen.sum()} rows; at least 10 are needed"
        )
    z = (
        direction(told.frame.along)
        if told.frame.along is not None
        else _along(positions[:, order], told)
    )
    height = np.where(seen, tip @ z, -np.inf)
    resting = height >= np.quantile(height[seen], 1 - RESTING)
    rest = np.array(
        [
            np.nanmedian(end[resting], axis=0)
            if np.isfinite(end[resting]).any()
            else np.full(3, np.nan)
            for end in np.moveaxis(positions, 1, 0)
        ]
    )
    lengths = _lengths(tip[seen], rest, z, told)
    outer = max(told.end_modules)
    base = (
        np.array(told.frame.base)
        if told.frame.base
        else rest[order[-1]] - lengths[: outer + 1].sum() * z
    )
    return Registration(_frame(z, told), base, lengths, rest)


def _along(
    positions: Float[np.ndarray, "rows ends 3"], told: LogMap
) -> Float[np.ndarray, "3"]:
    """From the innermost end outwards; of a tip alone, across the shell that it moves on, away from the inside."""
    tip = positions[:, -1][np.isfinite(positions[:, -1]).all(axis=1)]
    inner = (
        np.array(told.frame.base)
        if told.frame.base
        else np.nanmedian(positions[:, 0], axis=0)
    )
    if told.frame.base or positions.shape[1] > 1:
        way = np.median(tip, axis=0) - inner
        return way / np.linalg.norm(way)
    centered = tip - tip.mean(axis=0)
    z = np.linalg.svd(centered, full_matrices=False)[2][2]
    height = centered @ z
    across = np.sum(centered**2, axis=1) - (centered @ z) ** 2
    return -z if np.cov(height, across)[0, 1] > 0 else z


def _lengths(
    tip: np.ndarray, rest: np.ndarray, z: np.ndarray, told: LogMap
) -> np.ndarray:
    """As stated; else from where ends are at rest; else from how far the tip comes down as it goes aside."""
    modules = told.arm.modules
    outer = max(told.end_modules)
    if told.arm.lengths is not None:
        return np.array(told.arm.lengths)
    if told.arm.length is not None:
        return np.full(modules, told.arm.length / modules)
    if told.frame.base is not None:
        heights = (rest - np.array(told.frame.base)) @ z
        return _between(
            dict(zip(told.end_modules, heights, strict=True)) | {-1: 0.0}, modules
        )
    heights = rest @ z
    if len(rest) > 1:
        return _between(dict(zip(told.end_modules, heights, strict=True)), modules)
    off = tip - rest[told.end_modules.index(outer)]
    drop = -off @ z
    across = np.sum(off**2, axis=1) - (off @ z) ** 2
    far = across >= np.quantile(across, 0.5)
    length = ARC_DROP / max(float(np.median(drop[far] / across[far])), 1e-3)
    return np.full(modules, length / (outer + 1))


def _between(heights: dict[int, float], modules: int) -> np.ndarray:
    """Lengths of modules from heights of some ends: even between two of them, and as the mean elsewhere."""
    known = sorted(heights)
    slopes = {
        one: (heights[after] - heights[one]) / (after - one)
        for one, after in pairwise(known)
    }
    lengths = [
        next(
            (
                slope
                for one, slope in slopes.items()
                if one < module <= known[known.index(one) + 1]
            ),
            np.nan,
        )
        for module in range(modules)
    ]
    return np.clip(
        np.where(np.isnan(lengths), np.nanmean(lengths), lengths), 0.005, 2.0
    )


def _frame(z: np.ndarray, told: LogMap) -> np.ndarray:
    """Axes of the base frame as columns; x as stated, else the file's axis that is most across the arm."""
    likely = (
        direction(told.frame.x)
        if told.frame.x is not None
        else np.eye(3)[int(np.argmin(np.abs(z)))]
    )
    x = likely - (likely @ z) * z
    if np.linalg.norm(x) < 0.1:
        raise LogError("frame.x points along the arm; give a direction across it")
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
