"""Windows of the LSTM, computed by hand: values encode episode and time."""

import numpy as np
import pytest

from s2c2a.data.windows import controller_samples
from s2c2a_experiments.tip_lstm import lstm_samples

NEUTRAL = np.array([[-1.0, -2.0, -3.0, -4.0], [-5.0, -6.0, -7.0, -8.0]])


def telling(*shape: int) -> np.ndarray:
    """Two episodes of 100 samples: 10000 (episode + 1) + 10 t + k / 10."""
    start = 10000.0 * np.arange(1, 3)[:, None] + 10.0 * np.arange(100)
    return start.reshape(2, 100, *[1] * len(shape)) + np.broadcast_to(
        np.arange(shape[-1]) / 10, shape
    )


POSITIONS, ACTIONS = telling(3), telling(2, 4) + 0.5
SPLIT = lstm_samples(POSITIONS, ACTIONS, NEUTRAL)


def test_one_window_at_the_start_of_an_episode_is_as_computed_by_hand():
    """Episode two, t = 2: tips 0 0 0 1 2; 3 x neutral, A_0 A_1; p_3; target A_2."""
    row = 64 + 2
    inputs = {name: values[row] for name, values in SPLIT.training.inputs.items()}
    np.testing.assert_array_equal(
        inputs["positions"][:, 0], [20000, 20000, 20000, 20010, 20020]
    )
    np.testing.assert_array_equal(inputs["actions"][:3], [NEUTRAL] * 3)
    np.testing.assert_array_equal(inputs["actions"][3:, 1, 0], [20000.5, 20010.5])
    np.testing.assert_allclose(inputs["desired"], [20030, 20030.1, 20030.2], rtol=1e-7)
    np.testing.assert_allclose(
        SPLIT.training.targets[row, 1], [20020.5, 20020.6, 20020.7, 20020.8], rtol=1e-7
    )


def test_windows_with_an_unknown_tip_are_dropped():
    positions = POSITIONS.copy()
    positions[1, 20, 2] = np.nan  # desired once, and five times in a history
    split = lstm_samples(positions, ACTIONS, NEUTRAL)
    assert np.isfinite(split.training.inputs["positions"]).all()
    assert len(split.training.targets) == len(SPLIT.training.targets) - 6
    np.testing.assert_array_equal(split.test.targets, SPLIT.test.targets)


def test_padding_of_shorter_episodes_is_ignored():
    split = lstm_samples(POSITIONS, ACTIONS, NEUTRAL, (100, 60))
    targets = np.concatenate([part.targets for part in split.parts])
    assert targets.max() < 10000.0 * 2 + 10.0 * 60


@pytest.mark.parametrize("part", ["training", "validation", "test"])
def test_the_lstm_and_c2a_have_the_same_targets(part):
    """The same data, split alike: a fair comparison."""
    ours = controller_samples(telling(2, 3), ACTIONS, NEUTRAL)
    np.testing.assert_array_equal(
        getattr(SPLIT, part).targets, getattr(ours, part).targets
    )
