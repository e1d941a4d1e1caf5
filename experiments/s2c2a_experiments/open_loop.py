"""Predictions of a second without measurements: at rest, with vibration, and linear.

From a measured moment in held-out blocks on, each model predicts the tip from the
cables alone. `at rest` is the forward model of the recipe `best`. `with vibration` adds
what a linear system of second order makes of the measured error at that moment and of
the changes of the prediction. `linear with delays` is extended dynamic mode
decomposition (Korda and Mezić, Automatica 93, 2018) of delayed positions and cables,
with squares or without; a fifth of its training rows chooses delays and regularization.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from s2c2a.data import Recording
from s2c2a.errors import RecordingError, counted
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.strategies import training_data
from s2c2a_experiments.real import BEST, MODELS, HeldOutSplit, hidden_from
from s2c2a_experiments.real_models import cable_displacements

EXPERIMENT = "open-loop"
TIME = 1.0  # s, of a prediction
SPACING = 0.25  # s, between the moments from which predictions start
ORDER = 2  # of the system of the error
DELAYS = (2, 5, 10)
RIDGES = (1e-6, 1e-4, 1e-2)  # over the number of rows
FIT_SHARE = 0.8  # of the training rows; the others choose
VIBRATION_RIDGE = 1e-3  # of the mean square of its inputs

Track = Float[np.ndarray, "samples 3"]
Prediction = Callable[[int, int, int], Track]
"""(episode, sample at the start, steps) -> positions of the tip after each step [m]."""


class Tracks(NamedTuple):
    """What a prediction may use, by episode.

    Attributes:
        measured: positions of the tip [m].
        known: the same, NaN where hidden from training.
        at_rest: predictions of the forward model [m].
        cables: displacements of all cables, over their standard deviations.
    """

    measured: Float[np.ndarray, "episodes samples 3"]
    known: Float[np.ndarray, "episodes samples 3"]
    at_rest: Float[np.ndarray, "episodes samples 3"]
    cables: Float[np.ndarray, "episodes samples cables"]

    def runs(self, before: int) -> Iterator[tuple[int, int]]:
        """Training rows with so many known rows before, and one after them."""
        finite = np.isfinite(self.known).all(axis=-1)
        for episode, row in enumerate(finite):
            for sample in range(before, len(row) - 1):
                if row[sample - before : sample + 2].all():
                    yield episode, sample


def open_loop_rows(
    recording: Recording, split: HeldOutSplit, gap: int, seeds: Sequence[int]
) -> list[Row]:
    """Rows of the three models, mean and after half and all of `TIME`.

    Args:
        recording: with the tip.
        split: its held-out samples.
        gap: samples beside them that nothing uses.
        seeds: of training.

    Raises:
        RecordingError: no held-out stretch is longer than `TIME` and the delays.
    """
    steps = max(2, round(TIME * recording.arm.control_rate))
    errors: dict[str, list[Float[np.ndarray, " steps"]]] = {}
    for seed in seeds:
        tracks = _tracks(recording, split, gap, seed)
        starts = _starts(tracks, split, steps, recording.arm.control_rate)
        models: dict[str, Prediction] = {
            "at rest": at_rest(tracks),
            "with vibration": with_vibration(tracks),
            "linear with delays": linear_with_delays(tracks),
        }
        for name, predict in models.items():
            found = [
                np.linalg.norm(
                    predict(episode, start, steps)
                    - tracks.measured[episode, start + 1 : start + 1 + steps],
                    axis=-1,
                )
                for episode, start in starts
            ]
            errors.setdefault(name, []).append(np.mean(found, axis=0))
    arm = recording.arm.name
    rows = []
    for name, curves in errors.items():
        values = {
            "tip, mean over 1 s": [curve.mean() for curve in curves],
            "tip after 0.5 s": [curve[steps // 2 - 1] for curve in curves],
            "tip after 1 s": [curve[-1] for curve in curves],
        }
        for metric, found in values.items():
            heading = (EXPERIMENT, split.name, arm, "real", name, name)
            millimeters = over_seeds([1e3 * float(value) for value in found])
            rows.append(Row(*heading, metric, "mm", seeds=tuple(seeds), **millimeters))
    return rows


def _tracks(recording: Recording, split: HeldOutSplit, gap: int, seed: int) -> Tracks:
    """Tracks with the forward model of one training."""
    data = training_data(recording, BEST)
    training = hidden_from(data, split, gap)
    options, fit = MODELS["best"]
    model = options.train(training, fit, jax.random.key(seed)).network
    cables = cable_displacements(data)
    flat = cables.reshape(*cables.shape[:2], -1)
    spread = np.nanstd(flat, axis=(0, 1))
    return Tracks(
        data.states[..., -1, :3],
        training.states[..., -1, :3],
        np.asarray(options.predictions(model, data))[..., -1, :3],
        flat / np.where(spread > 0.0, spread, 1.0),
    )


def _starts(
    tracks: Tracks, split: HeldOutSplit, steps: int, rate: float
) -> list[tuple[int, int]]:
    """Moments from which a held-out second begins."""
    spacing = max(1, round(SPACING * rate))
    measured = np.isfinite(tracks.measured).all(axis=-1)
    starts = []
    for episode, held_out in enumerate(split.held_out & measured):
        for start in range(max(DELAYS), len(held_out) - steps, spacing):
            before = measured[episode, start - max(DELAYS) : start + 1]
            if before.all() and held_out[start + 1 : start + 1 + steps].all():
                starts.append((episode, start))
    if not starts:
        raise RecordingError(
            f"no held-out stretch has {counted(max(DELAYS) + steps, 'measured row')} in a row"
        )
    return starts


def at_rest(tracks: Tracks) -> Prediction:
    """The forward model alone."""

    def predict(episode: int, start: int, count: int) -> Track:
        return tracks.at_rest[episode, start + 1 : start + 1 + count]

    return predict


def with_vibration(tracks: Tracks) -> Prediction:
    """The forward model, and a linear system of its error."""
    errors = tracks.known - tracks.at_rest
    inputs, targets = [], []
    for episode, sample in tracks.runs(ORDER):
        recent = errors[episode, sample - ORDER + 1 : sample + 1]
        changes = _changes(tracks.at_rest[episode], sample)
        inputs.append(np.concatenate([recent.ravel(), changes.ravel()]))
        targets.append(errors[episode, sample + 1])
    matrix = np.array(inputs)
    weight = VIBRATION_RIDGE * np.mean(matrix**2) * len(matrix)
    weights = _ridge(matrix, np.array(targets), weight)

    def predict(episode: int, start: int, count: int) -> Track:
        resting = tracks.at_rest[episode]
        first = slice(start - ORDER + 1, start + 1)
        recent = list(tracks.measured[episode, first] - resting[first])
        for sample in range(start, start + count):
            changes = _changes(resting, sample)
            inputs = np.concatenate([*recent[-ORDER:], changes.ravel()])
            recent.append(inputs @ weights)
        return resting[start + 1 : start + 1 + count] + np.array(recent[ORDER:])

    return predict


def _changes(resting: Track, sample: int) -> np.ndarray:
    """Changes of the prediction up to the next sample."""
    return np.diff(resting[sample - ORDER + 1 : sample + 2], axis=0)


@dataclass(frozen=True)
class Lift:
    """Features of delayed positions and cables, as of extended mode decomposition.

    Attributes:
        delays: number of samples.
        squares: whether products of the present positions and cables count, too.
    """

    delays: int
    squares: bool

    def __call__(self, positions: np.ndarray, cables: np.ndarray) -> np.ndarray:
        """Features of the last `delays` positions, and of the cables up to the next."""
        parts = [positions.ravel(), cables.ravel(), np.ones(1)]
        if self.squares:
            now = np.concatenate([cables[-1], positions[-1]])
            parts.append(np.outer(now, now)[np.triu_indices(len(now))])
        return np.concatenate(parts)


def linear_with_delays(tracks: Tracks) -> Prediction:
    """A linear model of lifted delays, which the training rows choose."""
    known = tracks.known.reshape(-1, 3)
    center, spread = np.nanmean(known, axis=0), np.nanstd(known, axis=0)
    scaled = (tracks.measured - center) / spread
    best = None
    for delays, squares in product(DELAYS, (False, True)):
        lift = Lift(delays, squares)
        rows = list(tracks.runs(max(DELAYS)))
        matrix = np.array([lift(*_past(tracks, scaled, lift, *row)) for row in rows])
        targets = np.array([scaled[episode, sample + 1] for episode, sample in rows])
        fitted = round(FIT_SHARE * len(rows))
        for ridge in RIDGES:
            weights = _ridge(matrix[:fitted], targets[:fitted], ridge * fitted)
            error = np.mean((matrix[fitted:] @ weights - targets[fitted:]) ** 2)
            if best is None or error < best[0]:
                final = _ridge(matrix, targets, ridge * len(rows))
                best = error, lift, final
    assert best is not None
    _, lift, weights = best

    def predict(episode: int, start: int, count: int) -> Track:
        recent = list(scaled[episode, start - lift.delays + 1 : start + 1])
        cables = tracks.cables[episode]
        for sample in range(start, start + count):
            used = cables[sample - lift.delays + 1 : sample + 2]
            recent.append(lift(np.array(recent[-lift.delays :]), used) @ weights)
        return np.array(recent[lift.delays :]) * spread + center

    return predict


def _past(
    tracks: Tracks, scaled: np.ndarray, lift: Lift, episode: int, sample: int
) -> tuple[np.ndarray, np.ndarray]:
    """Delayed positions, and cables up to the next sample."""
    first = sample - lift.delays + 1
    cables = tracks.cables[episode, first : sample + 2]
    return scaled[episode, first : sample + 1], cables


def _ridge(inputs: np.ndarray, targets: np.ndarray, weight: float) -> np.ndarray:
    """Weights of a linear map by regularized least squares."""
    square = inputs.T @ inputs + weight * np.eye(inputs.shape[1])
    return np.linalg.solve(square, inputs.T @ targets)
