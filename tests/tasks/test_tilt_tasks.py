"""The circle with desired orientations: targets by hand from docs/results/protocol.md."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.tasks import Score, circle, load_task
from tilted import axis

TWIN = load_arm("twin_arm")
TILTS = {
    "tilt-40": 40,
    "tilt-50": 50,
    "tilt-60": 60,
    "tilt-0": 0,
    "tilt-50-a20": 50,
    "tilt-50-c20": 50,
}
TURNS = {"tilt-50-a20": 20, "tilt-50-c20": -20}


def tip_axes(name, arm=TWIN):
    return load_task(name, arm).desired_axes()[:, -1]


def angles_to_the_vertical(axes):
    return np.rad2deg(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2]))


@pytest.mark.parametrize("name", TILTS)
def test_the_tip_follows_the_circle(name):
    task = load_task(name, TWIN)
    assert (task.name, len(task.goals)) == (name, 200)
    np.testing.assert_array_equal(
        task.desired_positions(), circle(TWIN).desired_positions()
    )


@pytest.mark.parametrize("name", TILTS)
def test_the_tilt_grows_evenly_over_forty_steps_and_stays(name):
    shares = np.append(np.arange(1, 41) / 40, np.ones(160))
    np.testing.assert_allclose(
        angles_to_the_vertical(tip_axes(name)), TILTS[name] * shares, atol=1e-3
    )


@pytest.mark.parametrize(("name", "turn"), [("tilt-50", 0), *TURNS.items()])
@pytest.mark.parametrize(
    ("step", "tilt", "azimuth"),
    [(1, 1.25, 0), (20, 25, 0), (40, 50, 0), (80, 50, 90), (200, 50, 360)],
)
def test_a_turned_tilt_leads_or_lags_the_radial_direction_by_twenty_degrees(
    name, turn, step, tilt, azimuth
):
    np.testing.assert_allclose(
        tip_axes(name)[step - 1], axis(tilt, azimuth + turn), atol=1e-6
    )


@pytest.mark.parametrize("name", TURNS)
def test_a_turned_tilt_is_scored_by_azimuth_after_the_approach_as_well(name):
    *plain, azimuth = load_task(name, TWIN).scores
    assert plain == [Score("position"), Score("tilt")]
    assert (azimuth.metric, azimuth.module) == ("azimuth", -1)
    np.testing.assert_array_equal(azimuth.steps, [False] * 40 + [True] * 160)
