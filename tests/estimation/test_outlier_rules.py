"""The rules by which the filter rejects a sensor, one after the other."""

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.estimation.outliers import (
    REJECTION_TIME,
    SLOW_AVERAGING_TIME,
    Compared,
    SensorHistory,
    is_beyond_gate,
    judged,
)
from s2c2a.estimation.sensor_models import Innovation
from s2c2a.files.text import LARGEST
from s2c2a.spaces import NOISE_LIMIT

PERIOD = 0.1
PRESENT = jnp.array([True, True])
HEARD = SensorHistory.none(2)._replace(usual=jnp.zeros((2, 2)))
TRUE = jnp.asarray(True)
FALSE = jnp.asarray(False)


def compared(residual, by_biases=(0.0, 0.0), present=PRESENT, **limits):
    residual = jnp.asarray(residual, jnp.float32)
    innovation = Innovation(residual, jnp.zeros((2, 6)), jnp.ones(2), **limits)
    return Compared(residual, jnp.asarray(by_biases), present, innovation)


@pytest.mark.parametrize(("factor", "is_outlier"), [(0.99, False), (1.01, True)])
def test_rule_1_an_innovation_beyond_the_gate_is_an_outlier(factor, is_outlier):
    std = np.array([0.5, 2.0])
    residual = jnp.asarray(factor * NOISE_LIMIT * std)
    assert bool(is_beyond_gate(residual, jnp.diag(std**2), PRESENT)) is is_outlier


@pytest.mark.parametrize(("factor", "is_outlier"), [(0.99, False), (1.01, True)])
def test_rule_1_takes_the_root_mean_square_of_the_values_that_are_present(
    factor, is_outlier
):
    # 3 and 2 standard deviations, whose root mean square is sqrt(6.5)
    residual = factor * NOISE_LIMIT / np.sqrt(6.5) * jnp.array([0.3, 4.0, 0.0])
    covariance = jnp.diag(jnp.array([0.01, 4.0, 1.0]))
    present = jnp.array([True, True, False])
    assert bool(is_beyond_gate(residual, covariance, present)) is is_outlier


def test_rule_1_missing_values_do_not_dilute_an_outlier():
    residual = jnp.array([1.01 * NOISE_LIMIT, 0.0])
    one = jnp.array([True, False])
    assert is_beyond_gate(residual, jnp.eye(2), one)
    assert not is_beyond_gate(residual, jnp.eye(2), PRESENT)


def rejection(residual, **limits) -> float:
    values = compared(residual, **limits)
    return float(judged(HEARD, values, FALSE, PERIOD).rejected_for)


@pytest.mark.parametrize(("residual", "is_fault"), [(0.31, False), (0.33, True)])
def test_rule_2_a_residual_that_leaves_its_average_is_a_fault(residual, is_fault):
    # the average takes a twentieth of the first difference
    assert (rejection([residual, 0.0], max_change=0.3) > 0.0) is is_fault
    one = jnp.array([False, True])
    assert rejection([residual, 0.0], present=one, max_change=0.3) == 0.0


def test_rule_2_a_model_that_jumps_is_no_fault_of_the_sensor():
    jump = [1.0, 0.0]
    for by_encoders, is_fault in (
        (jump, True),
        ([0.0, 1.0], False),
        ([0.0, 0.0], False),
    ):
        seen = {"beside_encoders": jnp.array(by_encoders), "max_change": 0.3}
        assert (rejection(jump, **seen) > 0.0) is is_fault


def test_rule_2_a_measurement_that_cannot_be_is_a_fault():
    assert rejection([0.0, 0.0], max_change=-1.0) > 0.0
    assert rejection([0.0, 0.0], max_change=-1.0, present=~PRESENT) == 0.0


def test_rule_2_bend_biases_that_hide_a_fault_count_as_residual():
    hidden = compared([0.0, 0.0], by_biases=[0.0, 1.0], max_change=0.3)
    assert float(judged(HEARD, hidden, FALSE, PERIOD).rejected_for) > 0.0


def test_rule_3_an_outlier_rejects_its_sensor_for_a_while():
    calm = compared([0.0, 0.0])
    rejected = judged(HEARD, calm, TRUE, PERIOD)
    assert float(rejected.rejected_for) == pytest.approx(REJECTION_TIME)
    later = judged(rejected, calm, FALSE, PERIOD)
    assert float(later.rejected_for) == pytest.approx(REJECTION_TIME - PERIOD)
    assert rejection([0.0, 0.0]) == 0.0


def test_the_first_measurement_is_its_own_average():
    first = judged(SensorHistory.none(2), compared([3.0, 3.0]), FALSE, PERIOD)
    np.testing.assert_allclose(first.usual, 3.0)
    assert float(first.rejected_for) == 0.0


def test_the_average_follows_a_lasting_residual_by_the_time_since_the_last_one():
    after_silence = HEARD._replace(unseen_for=jnp.asarray(SLOW_AVERAGING_TIME / 2))
    history = judged(after_silence, compared([1.0, 1.0]), FALSE, 0.0)
    np.testing.assert_allclose(history.usual, 0.5, rtol=1e-6)
    assert float(history.unseen_for) == 0.0


def test_a_missing_measurement_changes_nothing_but_the_time_without_it():
    missing = compared([0.0, 0.0], present=~PRESENT, max_change=0.3)
    history = judged(SensorHistory.none(2), missing, FALSE, PERIOD)
    np.testing.assert_array_equal(history.usual, LARGEST)
    assert float(history.unseen_for) == pytest.approx(PERIOD)
    assert float(history.rejected_for) == 0.0
