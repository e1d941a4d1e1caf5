"""Training of sensor models: which samples judge."""

import numpy as np

from s2c2a.estimation.sensor_models.training import _held_out_and_seen


def test_samples_that_train_a_sensor_are_not_beside_those_that_judge_it():
    steps = np.concatenate([np.arange(500), np.arange(120)])
    held_out, seen = _held_out_and_seen(steps)
    np.testing.assert_array_equal(
        np.flatnonzero(held_out), [*range(200, 250), *range(450, 500)]
    )
    np.testing.assert_array_equal(
        np.flatnonzero(seen), [*range(175), *range(275, 425), *range(500, 620)]
    )
