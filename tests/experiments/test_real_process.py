"""The Gaussian process: a smooth function, its noise, and the distance from the data."""

import numpy as np
import pytest

from s2c2a_experiments.real_process import fit_process

NOISE = 0.02


def targets_of(inputs) -> np.ndarray:
    """Two known outputs, and one between them that is never known."""
    waves = np.sin(3.0 * inputs[:, 0])
    return np.stack([waves, np.full(len(inputs), np.nan), 10.0 * waves], axis=1)


@pytest.fixture(scope="module")
def process():
    random = np.random.default_rng(0)
    inputs = random.uniform(-1.0, 1.0, (200, 3))
    inputs[:, 2] = 0.5  # never varies
    noise = NOISE * random.normal(size=(200, 3)) * [1.0, 1.0, 10.0]
    targets = targets_of(inputs) + noise
    targets[:20] = np.nan  # hidden
    return fit_process(inputs, targets)


def test_means_are_those_of_the_function_within_the_noise(process):
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (100, 3))
    means, variances = process(inputs)
    errors = means - targets_of(inputs)
    assert np.abs(errors[:, 0]).max() < 3.0 * NOISE
    np.testing.assert_allclose(10.0 * means[:, 0], means[:, 2], atol=0.5)
    assert np.isnan(means[:, 1]).all()
    assert np.median(np.sqrt(variances[:, 0])) == pytest.approx(NOISE, rel=0.3)


def test_the_deviation_grows_away_from_the_data(process):
    _, variances = process(np.array([[0.0, 0.0, 0.5], [4.0, 0.0, 0.5]]))
    assert np.sqrt(variances[1, 0]) > 10.0 * np.sqrt(variances[0, 0])


def test_an_input_that_matters_has_the_shorter_length_scale(process):
    rates = process.logarithms.rates
    assert rates[0] > rates[1] + 1.0
