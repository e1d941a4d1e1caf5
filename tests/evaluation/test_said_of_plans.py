"""A fallback, or a plan that stood, is said; nothing is said of a run without."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.evaluation import said_of_plans

TWIN = load_arm("twin_arm")


def episode(**columns):
    return Episode(
        TWIN, {"time": np.arange(4.0), "actions": np.zeros((4, 3, 3)), **columns}
    )


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({}, ""),
        ({"rescued": np.zeros(4), "standing": np.zeros(4)}, ""),
        (
            {"rescued": np.array([0.0, 2.0, 3.0, np.nan])},
            "the plan was rescued in 2 steps",
        ),
        (
            {"extrapolation": np.array([0.0, 0.005, 0.007, np.nan])},
            "the plan was at the edge of what the data show, or beyond, in 1 steps",
        ),
        (
            {"rescued": np.array([0, 0, 1, 0]), "standing": np.array([1, 1, 0, 0])},
            "the plan was rescued in 1 steps, the plan stood although its cost could fall in 2 steps",
        ),
    ],
)
def test_rescues_and_standing_are_counted(columns, said):
    assert said_of_plans(episode(**columns)) == said


def test_plans_that_a_step_limit_holds_back_are_counted():
    """Two whole steps, after the first of which the end is where it shall be; the last step is a short one."""
    turned = np.deg2rad([0.0, 4.0, 8.0, 11.0])[:, None]
    planned = np.stack([np.sin(turned), 0.0 * turned, np.cos(turned)], axis=-1).repeat(
        3, axis=1
    )
    expected, desired = np.zeros((4, 3, 6)), np.full((4, 3, 3), np.nan)
    desired[:, -1] = [[0.02, 0, 0], [0, 0, 0], [0, 0.02, 0], [0.02, 0, 0]]
    said = "the plan was held back by the step limit of 4 deg (a slower --pace gives it time) in 1 steps"
    assert (
        said_of_plans(
            episode(planned=planned, expected=expected, desired_positions=desired)
        )
        == said
    )
