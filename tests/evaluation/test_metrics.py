"""Metrics with results computed by hand."""

import numpy as np
import pytest

from s2c2a.evaluation import curve_distances, position_errors
from s2c2a.evaluation.metrics import (
    METRICS,
    angles_deg,
    azimuth_errors_deg,
    clearances,
    orientation_errors_deg,
    step_lengths,
    tilt_errors_deg,
    tip_drifts,
)
from tilted import axis


def pointing(true, desired):
    """States and desired axes of one module at some (tilt, azimuth) [deg]."""
    states = np.zeros((len(true), 1, 6))
    states[:, 0, 3:] = [axis(*angles) for angles in true]
    return states, np.array([[axis(*angles)] for angles in desired])


def test_position_errors_are_distances_in_centimeters():
    """3-4-5 triangles: 5 cm, 0, and 13 cm in depth."""
    states = np.zeros((3, 2, 6))
    states[:, 1, :3] = [[0.03, 0.04, 0.5], [0.1, 0.2, 0.3], [0.0, 0.0, 0.63]]
    desired = np.full((3, 2, 3), np.nan)
    desired[:, 1] = [[0, 0, 0.5], [0.1, 0.2, 0.3], [0, 0, 0.5]]
    np.testing.assert_allclose(
        position_errors(states, desired), [5.0, 0.0, 13.0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("first", "second", "angle"),
    [
        ([0, 0, 1], [0, 0, 1], 0.0),
        ([0, 0, 1], [1, 0, 0], 90.0),
        ([0, 0, 1], [0, 1, 1], 45.0),
        ([0, 0, 1], [0, 0, -1], 180.0),
        ([0, 0, 3], [1, 0, 3**0.5], 30.0),
        ([0.6, 0, 0.8], [-0.6, 0, 0.8], 2 * np.rad2deg(np.arcsin(0.6))),
    ],
)
def test_angles_do_not_depend_on_the_lengths_of_vectors(first, second, angle):
    true = np.array(first, float).reshape(1, 1, 3)
    desired = np.array(second, float).reshape(1, 1, 3)
    assert angles_deg(true, desired)[0, 0] == pytest.approx(angle)
    assert angles_deg(desired, 5 * true)[0, 0] == pytest.approx(angle)


def test_small_angles_are_precise():
    tilted = np.array([[[1e-7, 0.0, 1.0]]])
    assert angles_deg(np.array([[[0.0, 0.0, 1.0]]]), tilted)[0, 0] == pytest.approx(
        np.rad2deg(1e-7)
    )


def test_tilt_errors_do_not_depend_on_the_azimuth():
    states, desired = pointing(
        [(40, 0), (40, 0), (70, 90), (0, 0)], [(50, 0), (50, 180), (60, -30), (30, 10)]
    )
    np.testing.assert_allclose(tilt_errors_deg(states, desired), [10, 10, 10, 30])


def test_azimuth_errors_do_not_depend_on_the_tilt():
    states, desired = pointing(
        [(40, 20), (10, 0), (50, 350), (50, 0)], [(50, 0), (50, 90), (50, 10), (20, 0)]
    )
    np.testing.assert_allclose(
        azimuth_errors_deg(states, desired), [20, 90, 20, 0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("true", "desired"), [(175, -175), (-175, 175), (355, 5), (170, 180), (-170, 180)]
)
def test_azimuth_errors_go_the_short_way_over_180_degrees(true, desired):
    assert azimuth_errors_deg(*pointing([(50, true)], [(50, desired)]))[
        0
    ] == pytest.approx(10)


def test_orientation_errors_are_angles_between_axes():
    """180 deg of azimuth at a tilt of 30 deg are 60 deg; 25 at 90 are 25."""
    states, desired = pointing(
        [(40, 0), (30, 0), (90, 0), (50, 7)], [(55, 0), (30, 180), (90, 25), (50, 7)]
    )
    np.testing.assert_allclose(
        orientation_errors_deg(states, desired), [15, 60, 25, 0], atol=1e-6
    )


def test_the_nearest_pair_of_point_and_obstacle_counts_in_every_step():
    points = np.array([[[0, 0, 0.2], [0, 0, 0.6]], [[0, 0, 0.2], [0.2, 0, 0.5]]])
    obstacles = np.tile([[0, 0, 0.9, 0.1], [0.3, 0, 0.5, 0.05]], (2, 1, 1))
    np.testing.assert_allclose(clearances(points, obstacles), [20.0, 5.0], atol=1e-12)


def test_a_tip_that_was_lost_for_a_step_lengthens_no_path():
    tips = np.array([[0.0, 0, 0], [0.03, 0, 0], [np.nan] * 3, [0.05, 0, 0]])
    assert np.nansum(step_lengths(tips)) == pytest.approx(5.0)


@pytest.mark.parametrize("name", ["path length", "clearance", "stillness", "position"])
def test_a_run_without_a_tip_has_no_score(name):
    assert np.isnan(METRICS[name].aggregate(np.full(3, np.nan)))


def test_an_obstacle_with_more_than_eight_centimeters_of_clearance_is_far():
    obstacles = [[[distance, 0, 0, 0.1]] for distance in (0.19, 0.181, 0.179, 0.10)]
    drifts = tip_drifts(np.zeros((4, 3)), np.array(obstacles), 0.08)
    assert np.isnan(drifts).tolist() == [False, False, True, True]


def test_every_obstacle_must_be_far():
    obstacles = np.array([[[0.3, 0, 0, 0.1], [0, 0.15, 0, 0.1]]])
    assert np.isnan(tip_drifts(np.zeros((1, 3)), obstacles, 0.08)).all()


def test_distances_from_a_curve_are_from_its_nearest_point():
    """Beside a side 3 cm, beyond its end 5 cm (3-4-5), and on a corner none."""
    curve = np.array([[0, 0, 0], [0, 0, 0.5], [0.1, 0, 0.5]])
    points = np.array([[-0.03, 0, 0.2], [0.14, 0, 0.53], [0, 0, 0.5]])
    distances = curve_distances(points, curve)
    np.testing.assert_allclose(distances, [0.03, 0.05, 0.0], atol=1e-12)
