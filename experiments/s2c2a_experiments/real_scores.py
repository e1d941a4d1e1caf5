"""Scores of a model's tip on held-out samples: its errors, and the deviation it states.

The deviation is the root of the expected squared distance of the tip
(`ForwardModel.predictive_std`), so that each axis has a third of its variance.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import spearmanr

from s2c2a.data.windows import forward_samples
from s2c2a.models import ForwardOptions
from s2c2a.models.forward_model import ForwardModel
from s2c2a.spaces import POSITION
from s2c2a.training import TrainingData

MM = 1e3  # mm/m
COVERED = 2.0  # deviations; a normal distribution holds 99.3 % of distances in them
CORRELATED = np.exp(
    -1.0
)  # least correlation within the correlation time, by definition
Mask = Bool[np.ndarray, "episodes samples"]


class TipScores(NamedTuple):
    """Errors of the tip on held-out samples.

    Attributes:
        errors: predicted minus true positions [mm].
        deviations: that the model states [mm].
        correlation_time: of the errors [rows] (`correlation_time`).
    """

    errors: Float[np.ndarray, "samples 3"]
    deviations: Float[np.ndarray, " samples"]
    correlation_time: int

    @property
    def distances(self) -> Float[np.ndarray, " samples"]:
        """Of predicted from true positions [mm]."""
        return np.linalg.norm(self.errors, axis=-1)

    @property
    def log_likelihood(self) -> float:
        """Mean log density of the true positions [nats; positions in mm].

        The density is normal, with a third of the variance along each axis.
        """
        variances = self.deviations**2 / 3.0
        misfits = self.distances**2 / variances
        volumes = 1.5 * np.log(2.0 * np.pi * variances)
        return float(np.mean(-0.5 * misfits - volumes))

    @property
    def coverage(self) -> float:
        """Share of the samples whose distance is below two deviations."""
        return float(np.mean(self.distances < COVERED * self.deviations))

    @property
    def rank_correlation(self) -> float | None:
        """Spearman's correlation of deviation and distance; None: both must vary."""
        if np.ptp(self.deviations) == 0.0 or np.ptp(self.distances) == 0.0:
            return None
        return float(spearmanr(self.deviations, self.distances).statistic)


def tip_scores(
    options: ForwardOptions,
    model: ForwardModel,
    training: TrainingData,
    data: TrainingData,
    judged: Mask,
    hidden: Mask,
) -> TipScores:
    """Scores of a trained model.

    A model that states no deviation gets a constant one, the root mean square of its
    errors on the validation samples of its training.

    Args:
        options: of the model.
        model: trained.
        training: its training data.
        data: to judge it by.
        judged: samples that count.
        hidden: samples that the training did not see, for the correlation time.
    """
    errors = tip_errors(options, model, data)
    judged = judged & np.isfinite(errors).all(axis=-1)
    deviations = MM * options.deviations(model, data)[..., -1]
    if not deviations[judged].any():
        constant = _validation_rms(options, model, training)
        deviations = np.full_like(deviations, constant)
    lag = correlation_time(np.where(hidden[..., None], errors, np.nan))
    return TipScores(errors[judged], deviations[judged], lag)


def _validation_rms(
    options: ForwardOptions, model: ForwardModel, training: TrainingData
) -> float:
    """Root mean square error on the validation samples of a training [mm]."""
    predicted = options.predictions(model, training)
    samples = forward_samples(predicted, training.states, training.lengths).validation
    differences = samples.inputs["configurations"] - samples.targets
    errors = MM * differences[:, -1, POSITION]
    squares = np.sum(errors**2, axis=-1)
    return float(np.sqrt(np.nanmean(squares)))


def tip_errors(
    options: ForwardOptions, model: ForwardModel, data: TrainingData
) -> Float[np.ndarray, "episodes samples 3"]:
    """Predicted minus true positions of the tip [mm]; NaN where unknown."""
    differences = options.predictions(model, data) - data.states
    errors = MM * differences[:, :, -1, POSITION]
    for row, length in zip(errors, data.lengths or (), strict=False):
        row[length:] = np.nan
    return errors


def correlation_time(errors: Float[np.ndarray, "episodes samples 3"]) -> int:
    """First lag [rows] at which the correlation of errors is below 1/e.

    If it is above at all lags that occur, their number: the time is at least as long.

    Args:
        errors: of samples in order of time; NaN where unknown.
    """
    centered = errors - np.nanmean(errors, axis=(0, 1))
    variance = np.nanmean(np.sum(centered**2, axis=-1))
    for lag in range(1, errors.shape[1]):
        late = centered[:, lag:]
        early = centered[:, :-lag]
        products = np.sum(late * early, axis=-1)
        known = products[np.isfinite(products)]
        if not len(known) or known.mean() < CORRELATED * variance:
            return lag
    return errors.shape[1]
