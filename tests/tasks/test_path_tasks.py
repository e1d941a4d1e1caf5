"""Square, eight, helix and star, by hand."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.tasks import load_task

TWIN = load_arm("twin_arm")
APPROACH = 40


def tips(name, arm=TWIN):
    return load_task(name, arm).desired_positions()[:, -1]


SQUARE = [[0.12, 0.12], [-0.12, 0.12], [-0.12, -0.12], [0.12, -0.12]]
EIGHT = [[0.18, 0.0], [0.0, 0.0], [-0.18, 0.0], [0.0, 0.0]]
HELIX = [[0.15, 0.0], [-0.15, 0.0], [0.15, 0.0], [-0.15, 0.0]]


@pytest.mark.parametrize(
    ("name", "corners", "heights"),
    [
        ("square", SQUARE, 0.54),
        ("eight", EIGHT, 0.55),
        ("helix", HELIX, [0.57, 0.5625, 0.555, 0.5475]),
    ],
)
def test_quarters_of_a_path_are_where_they_are_said_to_be(name, corners, heights):
    path = tips(name)
    quarter = (len(path) - APPROACH) // 4
    found = path[APPROACH - 1 :: quarter][:4]
    np.testing.assert_allclose(found[:, :2], corners, atol=1e-6)
    np.testing.assert_allclose(found[:, 2], heights, atol=1e-6)


def test_a_star_has_five_points_and_every_line_skips_one():
    points = tips("star")[APPROACH - 1 :: 40]
    np.testing.assert_allclose(np.linalg.norm(points[:, :2], axis=-1), 0.16, atol=1e-6)
    np.testing.assert_allclose(points[:, 2], 0.57)
    turned = np.diff(np.unwrap(np.arctan2(points[:, 1], points[:, 0])))
    np.testing.assert_allclose(turned, np.deg2rad(144.0), atol=1e-5)


def test_an_eight_is_0_18_m_wide():
    assert np.ptp(tips("eight")[APPROACH:, 1]) == pytest.approx(0.18, abs=1e-4)


@pytest.mark.parametrize("name", ["square", "eight", "star"])
def test_paths_close(name):
    np.testing.assert_allclose(tips(name)[APPROACH - 1], tips(name)[-1], atol=1e-6)


@pytest.mark.parametrize("name", ["square", "eight", "helix", "star"])
def test_paths_go_at_most_8_cm_a_second_and_scale_with_the_arm(name):
    speeds = np.linalg.norm(np.diff(tips(name), axis=0), axis=-1) * TWIN.control_rate
    assert speeds.max() < 0.0801
    short = TWIN.model_copy(update={"modules": TWIN.modules[:2]})
    np.testing.assert_allclose(tips(name, short), tips(name) * 0.4 / 0.6, atol=1e-6)
