"""A rescue, or a plan that stood, is said; nothing is said of a run without."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.evaluation import said_of_plans

TWIN = load_arm("twin_arm")


def episode(**columns):
    return Episode(TWIN, {"time": np.arange(4.0), "actions": np.zeros((4, 3, 3)), **columns})


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({}, ""),
        ({"rescued": np.zeros(4), "standing": np.zeros(4)}, ""),
        ({"rescued": np.array([0.0, 2.0, 3.0, np.nan])}, "the plan was rescued in 2 steps"),
        (
            {"rescued": np.array([0, 0, 1, 0]), "standing": np.array([1, 1, 0, 0])},
            "the plan was rescued in 1 steps, the plan stood although its cost could fall in 2 steps",
        ),
    ],
)
def test_rescues_and_standing_are_counted(columns, said):
    assert said_of_plans(episode(**columns)) == said
