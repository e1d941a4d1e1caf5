"""Metrics worked by hand."""

import numpy as np
import pytest

from s2c2a.evaluation import position_errors
from s2c2a.evaluation.metrics import configuration_errors_deg


def test_position_errors_are_distances_in_centimetres():
    """3-4-5 triangles: 5 cm, 0, and 13 cm in depth."""
    states = np.zeros((3, 2, 6))
    states[:, 1, :3] = [[0.03, 0.04, 0.5], [0.1, 0.2, 0.3], [0.0, 0.0, 0.63]]
    wanted = np.full((3, 2, 3), np.nan)
    wanted[:, 1] = [[0, 0, 0.5], [0.1, 0.2, 0.3], [0, 0, 0.5]]
    np.testing.assert_allclose(position_errors(states, wanted), [5.0, 0.0, 13.0], atol=1e-12)


def test_a_module_can_be_named_and_the_tip_is_meant_otherwise():
    states, wanted = np.zeros((1, 3, 6)), np.zeros((1, 3, 3))
    wanted[0, :, 0] = [0.01, 0.02, 0.03]
    found = [position_errors(states, wanted, *which)[0] for which in [(0,), (1,), (2,), ()]]
    np.testing.assert_allclose(found, [1.0, 2.0, 3.0, 3.0])


def test_where_nothing_is_wanted_there_is_no_error():
    wanted = np.full((2, 1, 3), np.nan)
    wanted[1] = 0.0
    np.testing.assert_array_equal(position_errors(np.zeros((2, 1, 6)), wanted), [np.nan, 0.0])


def test_where_the_end_points_does_not_count():
    states = np.zeros((1, 1, 6))
    states[..., 3:] = 7.0
    assert position_errors(states, np.zeros((1, 1, 3)))[0] == 0.0


@pytest.mark.parametrize(
    ("one", "two", "angle"),
    [
        ([0, 0, 1], [0, 0, 1], 0.0),
        ([0, 0, 1], [1, 0, 0], 90.0),
        ([0, 0, 1], [0, 1, 1], 45.0),
        ([0, 0, 1], [0, 0, -1], 180.0),
        ([0, 0, 3], [1, 0, 3**0.5], 30.0),
        ([0.6, 0, 0.8], [-0.6, 0, 0.8], 2 * np.rad2deg(np.arcsin(0.6))),
    ],
)
def test_configuration_errors_are_angles_whatever_the_lengths(one, two, angle):
    true, wanted = (np.array(vector, float).reshape(1, 1, 3) for vector in (one, two))
    assert configuration_errors_deg(true, wanted)[0, 0] == pytest.approx(angle)
    assert configuration_errors_deg(wanted, 5 * true)[0, 0] == pytest.approx(angle)


def test_small_angles_keep_their_digits():
    tilted = np.array([[[1e-7, 0.0, 1.0]]])
    assert configuration_errors_deg(np.array([[[0.0, 0.0, 1.0]]]), tilted)[0, 0] == pytest.approx(np.rad2deg(1e-7))


def test_every_step_and_module_has_its_own_angle():
    true = np.tile([0.0, 0.0, 1.0], (2, 3, 1))
    wanted = true.copy()
    wanted[1, 2] = [0.0, 1.0, 0.0]
    np.testing.assert_allclose(configuration_errors_deg(true, wanted), [[0, 0, 0], [0, 0, 90]])
