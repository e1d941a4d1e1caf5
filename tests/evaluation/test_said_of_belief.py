"""What was heard and found in a run is said; nothing where nothing is heard."""

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.evaluation import said_of_belief


def episode(**columns):
    return Episode(
        load_arm("twin_arm"),
        {"time": np.arange(4.0), "actions": np.zeros((4, 3, 3)), **columns},
    )


def test_senses_load_leans_and_what_was_left_out_are_said():
    leans = np.zeros((4, 3, 2))
    leans[2, 1, 0] = np.deg2rad(1.5)
    said = said_of_belief(
        episode(
            load=np.full(4, 0.052),
            leans=leans,
            **{"rejected.imu": np.array([0.0, 1.0, 1.0, 0.0])},
        )
    )
    assert (
        said
        == "heard imu; found 52 g at the tip, leans to 1.5 deg; imu was not believed in 2 steps"
    )


def test_nothing_is_said_where_nothing_is_heard():
    assert said_of_belief(episode(load=np.zeros(4), leans=np.zeros((4, 3, 2)))) == ""
