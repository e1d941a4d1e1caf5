"""Predictions of a second: a linear arm is predicted exactly, a static one at rest."""

import numpy as np
import pytest

from s2c2a.errors import RecordingError
from s2c2a_experiments.open_loop import (
    Lift,
    Tracks,
    _starts,
    linear_with_delays,
    with_vibration,
)
from s2c2a_experiments.real import HeldOutSplit

STEPS = 10


def tracks_of(measured: np.ndarray, at_rest: np.ndarray, cables: np.ndarray):
    known = measured.copy()
    known[:, 200:260] = np.nan
    return Tracks(measured, known, at_rest, cables)


def a_vibrating_arm(noise: float = 0.0) -> Tracks:
    """The tip follows the cables as a damped oscillator."""
    random = np.random.default_rng(0)
    cables = np.cumsum(random.normal(size=(1, 400, 3)), axis=1)
    tip = np.zeros((1, 400, 3))
    for step in range(2, 400):
        force = 0.3 * (cables[0, step] - tip[0, step - 1])
        tip[0, step] = 1.8 * tip[0, step - 1] - 0.8 * tip[0, step - 2] + force
    return tracks_of(tip, cables + noise * random.normal(size=cables.shape), cables)


@pytest.mark.parametrize("model", [with_vibration, linear_with_delays])
def test_a_linear_vibration_is_predicted_from_a_measured_moment(model):
    tracks = a_vibrating_arm()
    predicted = model(tracks)(0, 210, STEPS)
    measured = tracks.measured[0, 211 : 211 + STEPS]
    at_rest = tracks.at_rest[0, 211 : 211 + STEPS]
    error = np.linalg.norm(predicted - measured, axis=-1).max()
    assert error < 0.05 * np.linalg.norm(at_rest - measured, axis=-1).max()


def test_a_lift_has_the_products_of_the_present_positions_and_cables():
    positions, cables = np.ones((2, 3)), np.full((3, 2), 2.0)
    plain = Lift(2, squares=False)(positions, cables)
    squared = Lift(2, squares=True)(positions, cables)
    assert len(plain) == 6 + 6 + 1
    assert len(squared) == len(plain) + 5 * 6 // 2
    assert sorted(set(squared[len(plain) :])) == [1.0, 2.0, 4.0]


def test_held_out_stretches_that_are_too_short_are_refused():
    held_out = np.zeros((1, 400), bool)
    held_out[0, 210:215] = True
    with pytest.raises(RecordingError, match="no held-out stretch has"):
        _starts(a_vibrating_arm(), HeldOutSplit("blocks", held_out), STEPS, 10.0)
