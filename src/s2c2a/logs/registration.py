"""First estimate of the base frame and the module lengths, from the tracked ends."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.errors import counted
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.take import Ends, unit_vector

Vector = Float[np.ndarray, "3"]
# share of the rows that show the arm straight: those with the tip furthest along it
STRAIGHT_SHARE = 0.03
# drop of the tip, times the length, over the square of its distance from the axis;
# about the same whichever module bends
ARC_DROP = 0.65
MIN_ROWS = 10
MIN_LENGTH = 0.005  # m
MAX_LENGTH = 2.0  # m


class Registration(NamedTuple):
    """Base frame and module lengths.

    Attributes:
        axes: x, y, and z of the base frame as columns, frame of the log.
        base: origin of the base frame [m], frame of the log.
        lengths: lengths of the modules [m].
    """

    axes: Float[np.ndarray, "3 3"]
    base: Vector
    lengths: Float[np.ndarray, " modules"]


def estimate_registration(positions: Ends, log_map: LogMap) -> Registration:
    """Base frame as the map states it, completed from rest and motion of the ends.

    Args:
        positions: positions of the ends [m], frame of the log; NaN: not measured.
        log_map: the map.

    Raises:
        LogError: the outermost end is measured in too few rows.
    """
    order = np.argsort(log_map.end_modules)
    outer = max(log_map.end_modules)
    tip = positions[:, order[-1]]
    known = np.isfinite(tip).all(axis=1)
    z = _find_z(positions, log_map)
    is_straight = _straight_rows(tip, z)
    rest = np.array(
        [_median(positions[is_straight, end]) for end in range(positions.shape[1])]
    )
    lengths = _estimate_lengths(tip[known], rest, z, log_map)
    if log_map.frame.base:
        base = np.array(log_map.frame.base)
    else:
        reach = lengths[: outer + 1].sum()
        base = rest[order[-1]] - reach * z
    # axes as columns: x as stated, or along the log's axis most across the arm
    if log_map.frame.x is None:
        # of a plane, the axis in it
        axes = np.eye(3)
        if log_map.in_plane:
            axes = axes[:2]
        across = axes[np.argmin(np.abs(axes @ z))]
    else:
        across = unit_vector(log_map.frame.x)
    x = across - (across @ z) * z
    if np.linalg.norm(x) < 0.1:
        raise LogError("frame.x points along the arm; give a direction across it")
    x = x / np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z], axis=1)
    return Registration(rotation, base, lengths)


def straight_rows(positions: Ends, log_map: LogMap) -> Bool[np.ndarray, " rows"]:
    """Rows in which the tip is furthest along the arm.

    Raises:
        LogError: the outermost end is measured in too few rows.
    """
    tip = positions[:, int(np.argmax(log_map.end_modules))]
    return _straight_rows(tip, _find_z(positions, log_map))


def _straight_rows(tip: np.ndarray, z: np.ndarray) -> np.ndarray:
    known = np.isfinite(tip).all(axis=1)
    height = np.where(known, tip @ z, -np.inf)
    return height >= np.quantile(height[known], 1 - STRAIGHT_SHARE)


def _find_z(positions: np.ndarray, log_map: LogMap) -> np.ndarray:
    """Direction along the arm, as stated or estimated."""
    outer = int(np.argmax(log_map.end_modules))
    known = np.isfinite(positions[:, outer]).all(axis=1)
    if known.sum() < MIN_ROWS:
        raise LogError(
            f"the end of module {max(log_map.end_modules)} is measured in "
            f"{counted(known.sum(), 'row')}; at least {MIN_ROWS} are needed"
        )
    if log_map.frame.along is not None:
        return unit_vector(log_map.frame.along)
    return estimate_z(positions, log_map)


def _median(positions: Float[np.ndarray, "rows 3"]) -> Vector:
    if not np.isfinite(positions).any():
        return np.full(3, np.nan)
    return np.nanmedian(positions, axis=0)


def estimate_z(positions: Ends, log_map: LogMap) -> Vector:
    """Direction from the base, or the innermost end, to the tip, as the ends show it.

    A tip alone moves on a shell: z is normal to it and points away from its center.
    """
    positions = positions[:, np.argsort(log_map.end_modules)]
    tip = positions[:, -1]
    tip = tip[np.isfinite(tip).all(axis=1)]
    if log_map.frame.base or positions.shape[1] > 1:
        if log_map.frame.base:
            inner = np.array(log_map.frame.base)
        else:
            inner = np.nanmedian(positions[:, 0], axis=0)
        along = np.median(tip, axis=0) - inner
        return along / np.linalg.norm(along)
    centered = tip - tip.mean(axis=0)
    # a tip in the plane of a camera moves on an arc
    directions = np.linalg.svd(centered, full_matrices=False)[2]
    z = directions[1 if log_map.in_plane else 2]
    height = centered @ z
    distance = np.sum(centered**2, axis=1) - height**2
    return -z if np.cov(height, distance)[0, 1] > 0 else z


def _estimate_lengths(
    tip: Float[np.ndarray, "rows 3"],
    rest: Float[np.ndarray, "ends 3"],
    z: Vector,
    log_map: LogMap,
) -> Float[np.ndarray, " modules"]:
    """Stated lengths, or those of the ends at rest, or those of the tip's shell."""
    arm = log_map.arm
    ends = log_map.end_modules
    if arm.lengths is not None:
        return np.array(arm.lengths)
    if arm.length is not None:
        return np.full(arm.modules, arm.length / arm.modules)
    if log_map.frame.base is not None:
        heights = (rest - np.array(log_map.frame.base)) @ z
        known = dict(zip(ends, heights, strict=True))
        return _interpolate_lengths(known | {-1: 0.0}, arm.modules)
    if len(rest) > 1:
        return _interpolate_lengths(dict(zip(ends, rest @ z, strict=True)), arm.modules)
    # one end: rest has one row
    displacement = tip - rest[0]
    drop = -displacement @ z
    distance = np.sum(displacement**2, axis=1) - drop**2
    is_far = distance >= np.quantile(distance, 0.5)
    ratio = float(np.median(drop[is_far] / distance[is_far]))
    length = ARC_DROP / max(ratio, 1e-3)
    return np.full(arm.modules, length / (ends[0] + 1))


def _interpolate_lengths(heights: dict[int, float], modules: int) -> np.ndarray:
    """Lengths of modules from the heights of some ends.

    Modules between two known ends are equally long; others get the mean length.
    """
    lengths = np.full(modules, np.nan)
    for inner, outer in pairwise(sorted(heights)):
        slope = (heights[outer] - heights[inner]) / (outer - inner)
        lengths[inner + 1 : outer + 1] = slope
    lengths[np.isnan(lengths)] = np.nanmean(lengths)
    return np.clip(lengths, MIN_LENGTH, MAX_LENGTH)
