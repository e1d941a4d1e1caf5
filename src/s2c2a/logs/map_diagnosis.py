"""What a log shows without what its map states of frame, ends, drives, and sizes."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.errors import counted
from s2c2a.logs.cable_model import states_in_log
from s2c2a.logs.cable_search import identify_cables
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import LogFrame, LogMap
from s2c2a.logs.map_changes import Identified
from s2c2a.logs.model_fit import CableFit, Observations, predict_states
from s2c2a.logs.priors import first_guess, prior_std
from s2c2a.logs.registration import estimate_registration
from s2c2a.logs.take import Drives, Ends, LogTake, effective_drives
from s2c2a.logs.unit_checks import drive_unit_change, end_unit_change
from s2c2a.spaces import POSITION

# share of the motion that a poor fit misses, for which the map is checked; fits of real
# arms miss 6 % (opencr_v4) and 18 % (stanford_trunk, with vibration)
POOR = 0.25
# another fit explains a log clearly better below this share of the errors as stated
CLEARLY = 0.6
MOST = 0.5  # a model that misses more of the motion explains nothing
STRETCHES = 20  # every other one is fitted
FREE_MOTION = 0.1  # rms motion of the ends to which units are normalized [m]


class FreeFit(NamedTuple):
    """Fit without what the map states, or without its sizes.

    Attributes:
        found: what it identifies.
        missed: share of the motion that it misses.
        cost: half the robust sum of squared residuals [m^2].
    """

    found: Identified
    missed: float
    cost: float


class _KnownRows(NamedTuple):
    """Rows: drives, and ends in the frame and order of the map, by stretch."""

    columns: Drives
    ends: Float[np.ndarray, "rows ends 6"]
    stretches: np.ndarray

    def take(self, chosen: np.ndarray) -> "_KnownRows":
        return _KnownRows(*(values[chosen] for values in self))


def fit_freely(takes: Sequence[LogTake], log_map: LogMap) -> FreeFit:
    """Fit half of the stretches with free frame, ends, drives, and sizes.

    Returns:
        The fit, and what it misses of the other half.

    Raises:
        S2C2AError: the log has no fit.
    """
    rows = _rows(takes, log_map)
    place = np.arange(len(rows.columns)) * STRETCHES / len(rows.columns)
    is_middle = np.abs(place % 1 - 0.5) < 0.25
    is_fitted = rows.stretches % 2 == 0
    places = rows.ends[..., POSITION]
    numbers = range(len(log_map.ends))
    motions = [rms_motion(places[:, [number]]) for number in numbers]
    order = np.argsort(motions)
    # the map without statements; ends in the order of their motion
    free = {"angle_deg": None, "module": None, "positive": "unknown"}
    modules = sorted(log_map.end_modules)
    ends = [
        log_map.ends[end].model_copy(update={"module": module})
        for end, module in zip(order, modules, strict=True)
    ]
    free_map = log_map.model_copy(
        update={
            "drives": tuple(drive.model_copy(update=free) for drive in log_map.drives),
            "ends": tuple(ends),
            "frame": LogFrame(),
            "arm": log_map.arm.model_copy(update={"length": None, "lengths": None}),
        }
    )
    scale = free_scale(places)
    observations = _observe(rows.take(is_fitted), free_map, order, scale)
    measured = observations.states[:, free_map.end_modules, POSITION]
    registration = estimate_registration(measured, free_map)
    length = float(registration.lengths.sum())
    observations = replace(observations, axes=registration.axes, scale=length)
    fit, assignment, _ = identify_cables(
        observations, first_guess(registration, free_map), free_map
    )
    held_out = rows.take(~is_fitted & is_middle)
    found = Identified.of(fit, assignment, observations.axes, scale, order)
    unseen = _observe(held_out, free_map, order, scale)
    missed = missed_share(fit, replace(unseen, axes=observations.axes))
    return FreeFit(found, missed, fit.cost * (scale * length) ** 2)


def unit_change(free: FreeFit, is_better: bool, log_map: LogMap) -> str:
    """Clause on the unit under which the sizes of the arm are possible; may be empty."""
    if free.missed > POOR:  # the sizes of a poor fit mean nothing
        return ""
    lengths = free.found.lengths
    unit = ""
    if is_better or not (log_map.arm.length or log_map.arm.lengths):
        unit = end_unit_change(lengths, log_map)
    return unit or drive_unit_change(free.found.gain, float(lengths.min()), log_map)


def _rows(takes: Sequence[LogTake], log_map: LogMap) -> _KnownRows:
    drives = [effective_drives(each, log_map) for each in takes]
    columns = np.concatenate(drives)
    positions = np.concatenate([each.positions for each in takes])
    axes = np.concatenate([each.axes for each in takes])
    states = np.concatenate([positions, axes], axis=-1)
    known = np.isfinite(columns).all(axis=1)
    known &= np.isfinite(states[..., 0]).all(axis=1)
    if known.sum() < STRETCHES:
        raise LogError(f"{counted(known.sum(), 'row')} with drives and ends")
    stretches = np.arange(known.sum()) * STRETCHES // known.sum()
    return _KnownRows(columns[known], states[known], stretches)


def _observe(
    rows: _KnownRows, log_map: LogMap, order: np.ndarray, scale: float
) -> Observations:
    """Observations of ends in the order of their motion, divided by the scale."""
    states = np.full((len(rows.columns), log_map.arm.modules, 6), np.nan)
    states[:, log_map.end_modules] = rows.ends[:, order]
    states[..., POSITION] /= scale
    return Observations(
        rows.columns, states, np.eye(3), log_map.by_force, prior_std(log_map), 1.0
    )


def free_scale(positions: Ends) -> float:
    """Divisor with which ends of any unit move like those of most arms.

    Raises:
        LogError: the ends do not move.
    """
    scale = rms_motion(positions) / FREE_MOTION
    if not scale > 0:
        raise LogError("the ends do not move")
    return scale


def rms_motion(positions: Ends) -> float:
    """Rms distance of the ends from their mean [m]."""
    centered = positions - np.nanmean(positions, axis=0)
    squares = np.sum(centered**2, axis=-1)
    return float(np.sqrt(np.nanmean(squares)))


def missed_share(fit: CableFit, observations: Observations) -> float:
    """Share of the motion that a fit misses."""
    _, states = predict_states(
        fit.parameters, fit.wiring, observations.columns, observations.tension
    )
    with jax.enable_x64(True):
        predicted = states_in_log(
            fit.parameters, jnp.asarray(states), jnp.asarray(observations.axes)
        )
    measured = observations.states[..., POSITION]
    is_seen = np.isfinite(measured[..., 0])
    ends = np.asarray(predicted)[..., POSITION]
    errors = np.where(is_seen[..., None], ends, 0.0)
    errors -= np.nan_to_num(measured)
    count = is_seen.sum(axis=1)
    squares = np.sum(errors**2, axis=(1, 2))
    squares = squares[count > 0] / count[count > 0]
    motion = rms_motion(measured[:, is_seen.any(axis=0)])
    return float(np.sqrt(squares.mean())) / motion
