"""The warning that the seen tip disagrees with the model's stated deviation."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.evaluation import describe_disagreement

TWIN = load_arm("twin_arm")
STEPS = 300
STD = 3e-3  # m, of a position in space


def run(scale: float, shift: float = 0.0, seen: bool = True) -> Episode:
    """A run whose tip errs by `scale` stated deviations, and by a constant shift [m]."""
    random = np.random.default_rng(0)
    predicted = np.zeros((STEPS, 3, 6))
    states = np.full((STEPS, 3, 6), np.nan)
    noise = random.normal(scale=scale * STD / np.sqrt(3.0), size=(STEPS, 3))
    states[:, -1, :3] = noise + np.array([shift, 0.0, 0.0])
    columns = {
        "time": 0.1 * np.arange(STEPS),
        "actions": np.zeros((STEPS, 3, 3)),
        "predicted": predicted,
        "predictive_std": np.full((STEPS, 3), STD),
    }
    if seen:
        columns["sensor.states"] = states
    return Episode(TWIN, columns)


def test_errors_as_large_as_stated_are_no_disagreement():
    assert describe_disagreement(run(0.97)) == ""


@pytest.mark.parametrize(("scale", "shift"), [(1.5, 0.0), (0.9, 2.0 * STD)])
def test_larger_errors_and_a_lasting_shift_name_the_session(scale, shift):
    text = describe_disagreement(run(scale, shift))
    assert "which state 3.0 mm" in text
    assert "`s2c2a session`" in text


def test_a_tip_that_was_not_seen_disagrees_with_nothing():
    assert describe_disagreement(run(9.0, seen=False)) == ""
