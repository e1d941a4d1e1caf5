"""The steps of the Kalman filter against direct computations."""

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.estimation import kalman

F = np.array([[1.0, 0.1], [0.0, 0.95]])
H = np.array([[1.0, 0.0]])
Q = np.array([1e-4, 4e-3])
R_STD = np.array([0.2])


@jax.jit
def filter_step(mean, covariance, measurement, present):
    """Mean and covariance after a predict and an update."""
    mean = F @ mean
    covariance = kalman.predict(covariance, F, Q)
    residual = jnp.where(present, measurement - H @ mean, 0.0)
    jacobian = jnp.where(present, H, 0.0)
    innovation_cov = kalman.innovation_covariance(covariance, jacobian, R_STD)
    return kalman.update(mean, covariance, residual, jacobian, innovation_cov)


def step(mean, covariance, measurement, present=True):
    """One predict and update of the linear system above."""
    values = filter_step(mean, covariance, measurement, present)
    return tuple(np.asarray(value, float) for value in values)


def direct(mean, covariance, measurement):
    """The same by the textbook's equations in double precision."""
    mean = F @ mean
    covariance = F @ covariance @ F.T + np.diag(Q)
    innovation_cov = H @ covariance @ H.T + np.diag(R_STD**2)
    gain = covariance @ H.T @ np.linalg.inv(innovation_cov)
    mean = mean + gain @ (measurement - H @ mean)
    return mean, (np.eye(2) - gain @ H) @ covariance


def test_the_filter_is_the_textbooks():
    mean, covariance = np.zeros(2), np.eye(2)
    expected_mean, expected_covariance = np.zeros(2), np.eye(2)
    for measurement in np.cumsum(
        np.random.default_rng(0).normal(size=(200, 1)), axis=0
    ):
        mean, covariance = step(mean, covariance, measurement)
        expected_mean, expected_covariance = direct(
            expected_mean, expected_covariance, measurement
        )
        np.testing.assert_allclose(mean, expected_mean, atol=2e-5)
        np.testing.assert_allclose(covariance, expected_covariance, atol=2e-5)


def test_a_missing_measurement_changes_the_prediction_by_nothing():
    mean, covariance = np.array([1.0, -0.5]), np.diag([0.5, 0.1])
    updated, updated_cov = step(mean, covariance, np.array([99.0]), present=False)
    np.testing.assert_allclose(updated, F @ mean, rtol=1e-6)
    np.testing.assert_allclose(
        updated_cov, F @ covariance @ F.T + np.diag(Q), rtol=1e-5
    )


def test_the_covariance_stays_positive_in_single_precision():
    """A very precise sensor on a very uncertain state: the short form would fail."""
    covariance = np.diag([1e6, 1e6]).astype(np.float32)
    mean = np.zeros(2, np.float32)
    noise = np.array([1e-3], np.float32)
    for _ in range(100):
        innovation_cov = kalman.innovation_covariance(covariance, H, noise)
        mean, covariance = kalman.update(
            mean, covariance, np.zeros(1), H, innovation_cov
        )
        covariance = np.asarray(covariance)
        assert np.linalg.eigvalsh((covariance + covariance.T) / 2).min() > -1e-3
