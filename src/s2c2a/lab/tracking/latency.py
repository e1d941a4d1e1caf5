"""Latency of tracked poses relative to servo readings, from a small motion.

The arm itself lags behind its cables and vibrates, so that the lag of a plain cross
correlation is not the latency. A causal model therefore goes together with the delay:

    y(t + latency) = sum_i R_i x_i(t) + slow terms + constant,   x_i = G_i play(u(t))

with two vibration modes G_i = w^2 / (s^2 + 2 z w s + w^2), whose frequencies and
dampings are free, backlash of every cable (play operator), and first-order terms for
relaxation. The phase of a mode saturates at 180 deg, that of a delay grows with
frequency without bound. The gains R_i follow linearly (variable projection), and
residuals are whitened by an autoregressive model of every output, so that the fit
minimizes the error of one-step predictions.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.signal import lfilter

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.lab.tracking.poses import TrackingError

GRID_PERIOD = 0.002  # s, of the simulated modes
MODES = 2
RELAXATION_TIMES = (0.3, 3.0)  # s
WHITENING_ORDER = 8
ROUNDS = 2  # of a fit, each with new weights
MAX_EVALUATIONS = 30
LATENCIES = (-0.1, 0.3)  # s, of the search
FREQUENCIES = (0.4, 15.0)  # Hz
DAMPING_RATIOS = (0.01, 1.0)
MAX_BACKLASH = 0.005  # m
BACKLASH_STD = 0.0005  # m; of cables of one module about their mean
START_LATENCY = 0.02
START_FREQUENCIES = (1.2, 6.0)
START_DAMPING = 0.1
START_BACKLASH = 0.0005
START_NOISE = 0.002  # m, before the first weights
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
        frequencies: of the modes of the model [Hz].
    """

    seconds: float
    std: float
    explained: float
    frequencies: tuple[float, ...]


def find_latency(arm: ArmSpec, record: MotionRecord) -> Latency:
    """Find the latency of tracked positions relative to servo readings.

    Args:
        arm: cable angles and radii.
        record: of a motion of one module, as `identification.tracking` makes.

    Raises:
        LatencyError: there is too little motion, or too few frames, the tracked ends
            do not follow, or the data leave the latency open.
    """
    module = _moving_module(arm, record)
    near = _fitted(arm, record, module, slice(module, module + 1))
    ends = _fitted(arm, record, module, slice(None))
    # the lag of damped modes resembles a delay: where both fits differ, the model errs
    spread = abs(near.seconds - ends.seconds) / 2
    return _checked(replace(near, std=float(np.hypot(near.std, spread))))


def _fitted(arm: ArmSpec, record: MotionRecord, module: int, ends: slice) -> Latency:
    """Fit the model to some of the ends."""
    fit = _Fit(arm, replace(record, positions=record.positions[:, ends]), module)
    values = fit.start
    for _ in range(ROUNDS):
        solution = least_squares(
            fit.residuals,
            np.clip(values, fit.low + 1e-9, fit.high - 1e-9),
            bounds=(fit.low, fit.high),
            x_scale=fit.scales,
            max_nfev=MAX_EVALUATIONS,
        )
        values = solution.x
        fit.whiten(values)
    covariance = np.linalg.pinv(solution.jac.T @ solution.jac)
    std = float(np.sqrt(covariance[0, 0]))
    modes = np.exp(values[-2 * MODES : -MODES])
    return Latency(float(values[0]), std, fit.explained(values), tuple(modes.tolist()))


def bends_of(
    arm: ArmSpec, cables: Float[np.ndarray, "*batch modules cables"]
) -> Float[np.ndarray, "*batch modules 2"]:
    """Return the bends of modules without losses [rad] that cables command.

    Args:
        arm: geometry.
        cables: displacements [m], or tensions [N].
    """
    geometry = ArmGeometry.of(arm)
    shares = (cables - geometry.action_neutral) / geometry.action_scale[:, None]
    bends = np.einsum("mkc,...mc->...mk", geometry.bend_matrices, shares)
    return bends * geometry.action_bends[:, None]


def _moving_module(arm: ArmSpec, record: MotionRecord) -> int:
    """Index of the module that moves most."""
    if len(record.times) < MIN_FRAMES or not np.isfinite(record.cables).all():
        raise LatencyError(
            f"{len(record.times)} servo readings, or missing ones among them; give at "
            f"least {MIN_FRAMES} complete readings"
        )
    deviations = np.linalg.norm(bends_of(arm, record.cables).std(axis=0), axis=-1)
    module = int(deviations.argmax())
    if deviations[module] < MIN_BEND:
        raise LatencyError(
            f"the arm moved by {np.rad2deg(deviations[module]):.2f} deg (standard "
            f"deviation); at least {np.rad2deg(MIN_BEND):.1f} deg are needed. Check "
            "that the servos are powered and follow"
        )
    return module


def _checked(latency: Latency) -> Latency:
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


class _Fit:
    """Residuals of the model at parameters.

    Parameters: latency [s], backlash of every cable of the module [m], logarithms of
    the modes' frequencies [Hz] and damping ratios.
    """

    def __init__(self, arm: ArmSpec, record: MotionRecord, module: int):
        geometry = ArmGeometry.of(arm)
        self._times = record.times
        self._cables = record.cables[:, module] - geometry.action_neutral[module]
        scale = geometry.action_bends[module] / geometry.action_scale[module]
        self._bend_matrix = geometry.bend_matrices[module] * scale
        self._direction = _main_direction(self._cables @ self._bend_matrix.T)
        begin, end = record.times[[0, -1]]
        self._grid = np.arange(begin, end, GRID_PERIOD)
        self._arrivals, self._outputs = _outputs(record, begin, end)
        count = self._outputs.shape[1]
        self._filters = [np.ones(1)] * count
        self._noises = np.full(count, START_NOISE)
        self._describe_parameters(record.cables.shape[-1])

    def _describe_parameters(self, cables: int) -> None:
        def parameters(latency, backlash, frequency, damping) -> np.ndarray:
            modes = np.broadcast_to(frequency, MODES), np.broadcast_to(damping, MODES)
            return np.concatenate([[latency], np.full(cables, backlash), *modes])

        self._backlashes = slice(1, 1 + cables)
        logs = np.log([*FREQUENCIES, *DAMPING_RATIOS, START_DAMPING])
        self.low = parameters(LATENCIES[0], 0.0, logs[0], logs[2])
        self.high = parameters(LATENCIES[1], MAX_BACKLASH, logs[1], logs[3])
        self.scales = parameters(0.005, 1e-4, 0.1, 0.3)
        self.start = parameters(
            START_LATENCY, START_BACKLASH, np.log(START_FREQUENCIES), logs[4]
        )

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Whitened errors over their standard deviations, and the prior."""
        regressors = self._regressors(values)
        errors = [
            _projected(_filtered(regressors, taps), _filtered(output, taps)) / noise
            for output, taps, noise in zip(
                self._outputs.T, self._filters, self._noises, strict=True
            )
        ]
        backlashes = values[self._backlashes]
        prior = (backlashes - backlashes.mean()) / BACKLASH_STD
        return np.concatenate([*errors, prior])

    def whiten(self, values: np.ndarray) -> None:
        """Choose filters and weights by the errors at parameters."""
        errors = _projected(self._regressors(values), self._outputs)
        self._filters = [_whitening_filter(error) for error in errors.T]
        pairs = zip(errors.T, self._filters, strict=True)
        self._noises = np.array([_filtered(error, taps).std() for error, taps in pairs])

    def explained(self, values: np.ndarray) -> float:
        """Share of the variance of the strongest output that the model explains."""
        errors = _projected(self._regressors(values), self._outputs).var(axis=0)
        variances = self._outputs.var(axis=0)
        strongest = variances.argmax()
        return float(1.0 - errors[strongest] / variances[strongest])

    def _regressors(self, values: np.ndarray) -> np.ndarray:
        """Responses of modes and relaxation at the exposures, shape (frames, n)."""
        bend = self._bend_after_backlash(values[self._backlashes])
        modes = np.exp(values[-2 * MODES :]).reshape(2, MODES).T
        responses = [_mode(bend, frequency, ratio) for frequency, ratio in modes]
        responses += [_relaxation(bend, time) for time in RELAXATION_TIMES]
        exposures = self._arrivals - values[0]
        columns = [np.interp(exposures, self._grid, one) for one in responses]
        drift = exposures - exposures.mean()
        columns += [np.ones_like(exposures), drift]
        regressors = np.stack(columns, axis=1)
        return regressors / np.sqrt((regressors**2).mean(axis=0) + 1e-30)

    def _bend_after_backlash(self, widths: np.ndarray) -> np.ndarray:
        """Bend along the main direction on the grid [rad]."""
        bends = play(self._cables, widths) @ self._bend_matrix.T
        bend = (bends - bends[0]) @ self._direction
        return np.interp(self._grid, self._times, bend)


def play(
    cables: Float[np.ndarray, "n cables"], widths: Float[np.ndarray, " cables"]
) -> Float[np.ndarray, "n cables"]:
    """Return what backlash transmits of a motion (play operator).

    Args:
        cables: of one module [m].
        widths: backlash of every cable [m].
    """
    half_widths = widths / 2
    columns = zip(cables.T.tolist(), half_widths.tolist(), strict=True)
    return np.array([_play_of_one(*column) for column in columns]).T


def _play_of_one(path: list[float], half_width: float) -> list[float]:
    """Play operator of one cable; plain numbers are faster than arrays of three."""
    transmitted = []
    last = path[0]
    for value in path:
        last = min(max(last, value - half_width), value + half_width)
        transmitted.append(last)
    return transmitted


def _main_direction(bends: np.ndarray) -> np.ndarray:
    return np.linalg.svd(bends - bends.mean(axis=0), full_matrices=False)[2][0]


def _outputs(
    record: MotionRecord, begin: float, end: float
) -> tuple[np.ndarray, np.ndarray]:
    """Arrival times, and the coordinates of ends that move enough."""
    positions = record.positions.reshape(len(record.positions), -1)
    latest = end + LATENCIES[0]
    inside = (record.arrival_times > begin + WARM_UP) & (record.arrival_times < latest)
    kept = inside & np.isfinite(positions).all(axis=1)
    if kept.sum() < MIN_FRAMES:
        raise LatencyError(
            f"{kept.sum()} frames with all module ends arrived during the motion; at "
            f"least {MIN_FRAMES} are needed. Check the tracker and its view"
        )
    outputs = positions[kept]
    moving = outputs.std(axis=0) > MIN_RESPONSE
    if not moving.any():
        raise LatencyError(
            "the tracked ends stand still while the servos move; check that the "
            "tracker is alive and that its bodies are on this arm"
        )
    return record.arrival_times[kept], outputs[:, moving]


def _mode(values: np.ndarray, frequency: float, ratio: float) -> np.ndarray:
    """Response of a vibration mode (bilinear transform)."""
    omega = 2 * np.pi * frequency
    rate = 2 / GRID_PERIOD
    gains = np.array([1.0, 2.0, 1.0]) * omega**2
    damping = 2 * ratio * omega * rate
    poles = np.array(
        [
            rate**2 + damping + omega**2,
            2 * omega**2 - 2 * rate**2,
            rate**2 - damping + omega**2,
        ]
    )
    return lfilter(gains / poles[0], poles / poles[0], values)


def _relaxation(values: np.ndarray, time: float) -> np.ndarray:
    """Response of a first-order lag (bilinear transform)."""
    ratio = 2 * time / GRID_PERIOD
    return lfilter(np.ones(2) / (1 + ratio), [1.0, (1 - ratio) / (1 + ratio)], values)


def _filtered(values: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Values after a filter, without its beginning; frames are evenly spaced."""
    return lfilter(taps, 1.0, values, axis=0)[len(taps) :]


def _projected(regressors: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """What the best linear combination of regressors leaves of outputs."""
    basis, _ = np.linalg.qr(regressors)
    return outputs - basis @ (basis.T @ outputs)


def _whitening_filter(errors: np.ndarray) -> np.ndarray:
    """Taps that predict every error from those before (Yule-Walker)."""
    order = range(WHITENING_ORDER + 1)
    lags = np.array([errors[: len(errors) - lag] @ errors[lag:] for lag in order])
    toeplitz = lags[np.abs(np.subtract.outer(order[:-1], order[:-1]))]
    toeplitz = toeplitz + 1e-9 * lags[0] * np.eye(WHITENING_ORDER)
    return np.concatenate([[1.0], -np.linalg.solve(toeplitz, lags[1:])])
