"""Latency of tracked poses relative to servo readings, from a small motion.

The arm itself lags behind its cables and vibrates, so that the lag of a plain cross
correlation is not the latency. A causal model therefore goes together with the delay
(`lab.tracking.delayed_response`): two vibration modes, backlash of the cables, and
first-order terms for relaxation.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import counted
from s2c2a.lab.tracking.delayed_response import Motion, SearchRanges, identify_response
from s2c2a.lab.tracking.poses import TrackingError

GRID_PERIOD = 0.002  # s, of the simulated modes
LATENCIES = (-0.1, 0.3)  # s, of the search
MAX_BACKLASH = 0.0025  # m; half-width
SEARCH = SearchRanges(
    low=np.array([LATENCIES[0], 0.0, 0.4, 0.01]),
    high=np.array([LATENCIES[1], MAX_BACKLASH, 15.0, 1.0]),
    start=np.array([0.02, 0.00025, 1.2, 6.0, 0.1, 0.1]),
    lags=(0.3, 3.0),
)
"""Two modes, and first-order terms for relaxation."""
MIN_FRAMES = 200
MIN_BEND = np.deg2rad(1.5)  # standard deviation of the excited bend
MIN_RESPONSE = 0.002  # m; standard deviation of an output that counts
MAX_STD = 0.02  # s
MIN_EXPLAINED = 0.8  # of the variance of the strongest output
WARM_UP = 0.5  # s; the model begins at rest


class LatencyError(TrackingError):
    """The recorded motion does not determine the latency."""


@dataclass(frozen=True, eq=False)
class MotionRecord:
    """Cables and tracked ends during a motion.

    Attributes:
        times: of the servo readings [s], shape (n,).
        cables: displacements [m], or tensions [N], shape (n, modules, cables).
        arrival_times: of the frames, on the same clock [s], shape (frames,).
        positions: of the tracked ends from the base, in one fixed frame [m], shape
            (frames, ends, 3); NaN where an end is lost.
    """

    times: Float[np.ndarray, " n"]
    cables: Float[np.ndarray, "n modules cables"]
    arrival_times: Float[np.ndarray, " frames"]
    positions: Float[np.ndarray, "frames ends 3"]


@dataclass(frozen=True)
class Latency:
    """Latency of a tracker.

    Attributes:
        seconds: from exposure to arrival, relative to servo readings [s].
        std: standard deviation, of noise and of the model's choice of ends [s].
        explained: share of the variance of the strongest output that the model
            explains.
    """

    seconds: float
    std: float
    explained: float


def find_latency(arm: ArmSpec, record: MotionRecord) -> Latency:
    """Find the latency of tracked positions relative to servo readings.

    Args:
        arm: cable angles and radii.
        record: of a motion of one module, as `calibration_motions` makes.

    Raises:
        LatencyError: there is too little motion, or too few frames, the tracked ends
            do not follow, or the data leave the latency open.
    """
    # index of the module that moves most
    if len(record.times) < MIN_FRAMES or not np.isfinite(record.cables).all():
        raise LatencyError(
            f"{counted(len(record.times), 'servo reading')}, or missing ones among "
            f"them; give at least {MIN_FRAMES} complete readings"
        )
    deviations = np.linalg.norm(
        ArmGeometry.of(arm).commanded_bends(record.cables).std(axis=0), axis=-1
    )
    module = int(deviations.argmax())
    if deviations[module] < MIN_BEND:
        raise LatencyError(
            f"the arm moved by {np.rad2deg(deviations[module]):.2f} deg (standard "
            f"deviation); at least {np.rad2deg(MIN_BEND):.1f} deg are needed. Check "
            "that the servos are powered and follow"
        )
    near = _fitted(arm, record, module, slice(module, module + 1))
    ends = _fitted(arm, record, module, slice(None))
    # the lag of damped modes resembles a delay: where both fits differ, the model errs
    spread = abs(near.seconds - ends.seconds) / 2
    latency = replace(near, std=float(np.hypot(near.std, spread)))
    if latency.explained < MIN_EXPLAINED:
        raise LatencyError(
            f"the servos explain {100 * latency.explained:.0f} % of the tracked motion; "
            f"at least {100 * MIN_EXPLAINED:.0f} % are needed. The tracker does not "
            "follow, sees another body, or something else moves the arm"
        )
    low, high = LATENCIES
    std = latency.std
    if std > MAX_STD or not low + std < latency.seconds < high - std:
        raise LatencyError(
            f"the motion leaves the latency open: {1000 * latency.seconds:.0f} ms with "
            f"a standard deviation of {1000 * std:.0f} ms; {1000 * MAX_STD:.0f} ms are "
            "accepted. Friction, backlash and strong damping hide a delay: record "
            "longer, or measure the latency on a stiffer arm with the same tracker"
        )
    return latency


def _fitted(arm: ArmSpec, record: MotionRecord, module: int, ends: slice) -> Latency:
    """Fit the model to some of the ends."""
    motion = _motion(arm, replace(record, positions=record.positions[:, ends]), module)
    found = identify_response(motion, SEARCH)
    variances = motion.outputs.var(axis=0)
    strongest = variances.argmax()
    left = found.residuals[:, strongest].var() / variances[strongest]
    return Latency(found.delay, found.delay_std, float(1.0 - left))


def _motion(arm: ArmSpec, record: MotionRecord, module: int) -> Motion:
    """Motion of the ends by the cables of a module, along its main direction."""
    geometry = ArmGeometry.of(arm)
    cables = record.cables[:, module] - geometry.action_neutral[module]
    scale = geometry.action_bends[module] / geometry.action_scale[module]
    bend_matrix = geometry.bend_matrices[module] * scale
    bends = cables @ bend_matrix.T
    centered = bends - bends.mean(axis=0)
    directions = np.linalg.svd(centered, full_matrices=False)[2]
    weights = bend_matrix.T @ directions[0]
    arrivals, outputs = _outputs(record)
    return Motion(record.times, cables, weights, GRID_PERIOD, arrivals, outputs)


def _outputs(record: MotionRecord) -> tuple[np.ndarray, np.ndarray]:
    """Arrival times, and the coordinates of ends that move enough."""
    positions = record.positions.reshape(len(record.positions), -1)
    begin, end = record.times[[0, -1]]
    latest = end + LATENCIES[0]
    inside = (record.arrival_times > begin + WARM_UP) & (record.arrival_times < latest)
    kept = inside & np.isfinite(positions).all(axis=1)
    if kept.sum() < MIN_FRAMES:
        raise LatencyError(
            f"{counted(kept.sum(), 'frame')} with all module ends arrived during the "
            f"motion; at least {MIN_FRAMES} are needed. Check the tracker and its view"
        )
    outputs = positions[kept]
    moving = outputs.std(axis=0) > MIN_RESPONSE
    if not moving.any():
        raise LatencyError(
            "the tracked ends stand still while the servos move; check that the "
            "tracker is alive and that its bodies are on this arm"
        )
    return record.arrival_times[kept], outputs[:, moving]
