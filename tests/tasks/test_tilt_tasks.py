"""The circle with desired orientations: targets by hand from docs/results/protocol.md."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.tasks import Score, circle, load_task
from tilted import axis

TWIN = load_arm("twin_arm")
TURNS = {"tilt-50-a20": 20, "tilt-50-c20": -20}
TILTS = {f"tilt-{tilt}": tilt for tilt in (40, 50, 60, 0)} | dict.fromkeys(TURNS, 50)


def tip_axes(name):
    return load_task(name, TWIN).desired_axes()[:, -1]


@pytest.mark.parametrize("name", TILTS)
def test_the_tip_follows_the_circle(name):
    expected = circle(TWIN).desired_positions()
    np.testing.assert_array_equal(load_task(name, TWIN).desired_positions(), expected)


@pytest.mark.parametrize("name", TILTS)
def test_the_tilt_grows_evenly_over_forty_steps_and_stays(name):
    shares = np.append(np.arange(1, 41) / 40, np.ones(160))
    x, y, z = tip_axes(name).T
    tilts = np.rad2deg(np.arctan2(np.hypot(x, y), z))
    np.testing.assert_allclose(tilts, TILTS[name] * shares, atol=1e-3)


@pytest.mark.parametrize(("name", "turn"), [("tilt-50", 0), *TURNS.items()])
@pytest.mark.parametrize(
    ("step", "tilt", "azimuth"),
    [(1, 1.25, 0), (20, 25, 0), (40, 50, 0), (80, 50, 90), (200, 50, 360)],
)
def test_a_turned_tilt_leads_or_lags_the_radial_direction_by_twenty_degrees(
    name, turn, step, tilt, azimuth
):
    found = tip_axes(name)[step - 1]
    np.testing.assert_allclose(found, axis(tilt, azimuth + turn), atol=1e-6)


@pytest.mark.parametrize("name", TURNS)
def test_a_turned_tilt_is_scored_by_azimuth_after_the_approach_as_well(name):
    *plain, azimuth = load_task(name, TWIN).scores
    assert plain == [Score("position"), Score("tilt")]
    assert (azimuth.metric, azimuth.module) == ("azimuth", -1)
    np.testing.assert_array_equal(azimuth.steps, [False] * 40 + [True] * 160)
