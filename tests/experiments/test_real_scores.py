"""Scores of a tip: likelihood, coverage, rank correlation and correlation time."""

import numpy as np
import pytest

from s2c2a.data.windows import stretches
from s2c2a.training import TrainingData
from s2c2a_experiments.real_models import ReferenceModel
from s2c2a_experiments.real_scores import TipScores, correlation_time, tip_scores


def scores(errors, deviations) -> TipScores:
    return TipScores(np.asarray(errors, float), np.asarray(deviations, float), 1)


def test_the_log_likelihood_is_that_of_a_normal_distribution():
    # one deviation along each axis: sqrt(3) of the distance
    each = -0.5 - np.log(2.0) - 0.5 * np.log(2.0 * np.pi)
    one = scores([[2.0, 2.0, 2.0]], [2.0 * np.sqrt(3.0)])
    assert one.log_likelihood == pytest.approx(3.0 * each)


def test_coverage_is_the_share_within_two_deviations():
    assert scores([[3.0, 0, 0], [0, 5.0, 0]], [2.0, 2.0]).coverage == 0.5


def test_the_rank_correlation_needs_deviations_that_vary():
    errors = [[1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0]]
    assert scores(errors, [1.0, 1.0, 1.0]).rank_correlation is None
    assert scores(errors, [1.0, 5.0, 6.0]).rank_correlation == pytest.approx(1.0)


def test_the_correlation_time_is_that_of_an_autoregressive_process():
    random = np.random.default_rng(0)
    errors = np.zeros((1, 20_000, 3))
    for row in range(1, 20_000):
        errors[0, row] = 0.9 * errors[0, row - 1] + random.normal(size=3)
    errors += 50.0  # a constant error does not count
    # 0.9 ** 10 < 1 / e < 0.9 ** 9
    assert correlation_time(errors) == pytest.approx(10, abs=1)
    errors[:, ::7] = np.nan
    assert correlation_time(errors) == pytest.approx(10, abs=1)


def test_errors_that_stay_correlated_have_at_least_the_time_that_is_known():
    errors = np.full((1, 200, 3), np.nan)
    errors[0, :20] = 1.0
    errors[0, 100:120] = -1.0
    assert correlation_time(errors) == 20


class Still(ReferenceModel):
    """Predicts zero, and states no deviation."""

    def train(self, data, fit, key, progress=None):
        raise NotImplementedError

    def predictions(self, model, data):
        return np.zeros_like(data.states)


def test_a_model_that_states_no_deviation_gets_that_of_its_validation_samples(make_arm):
    states = np.zeros((1, 400, 1, 6))
    states[0, :, 0, 0] = 0.001  # m
    states[0, 390:] = np.nan
    for _, validation in stretches([390])[1]:
        states[0, validation, 0, 0] = 0.003
    data = TrainingData(make_arm(1), states[..., :3], states[..., :3], states)
    judged = np.zeros((1, 400), bool)
    judged[0, 380:] = True  # half of them unknown
    result = tip_scores(Still(), None, data, data, judged, judged)
    np.testing.assert_allclose(result.distances, np.ones(10))
    np.testing.assert_allclose(result.deviations, np.full(10, 3.0))
