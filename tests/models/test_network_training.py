"""Training the two networks of the paper, tiny and short, on the small recording."""

import jax
import numpy as np
import pytest

from s2c2a.data import controller_samples, forward_samples
from s2c2a.estimation import configuration_map_for
from s2c2a.models import History
from s2c2a.models.layers import Scaling
from s2c2a.strategies import TrainedNetworks, train_s2c2a
from s2c2a.training import TrainingData

KEY = jax.random.key(1)


@pytest.fixture(scope="module")
def told() -> list[tuple]:
    """What the training below tells of its progress."""
    return []


@pytest.fixture(scope="module")
def trained(recording, tiny_recipe, told) -> TrainedNetworks:
    """Trained here, unlike the networks that most tests read."""
    return train_s2c2a(
        recording, tiny_recipe, seed=7, progress=lambda *what: told.append(what[:3])
    )


@pytest.fixture(scope="module")
def training_data(recording) -> TrainingData:
    sensed = configuration_map_for(recording.arm).configurations(recording.readings())
    return TrainingData(
        recording.arm, sensed, recording.actions, recording.sensor("states")
    )


def test_training_lowers_both_losses_of_both_networks(trained):
    for curve in (result.curve for result in trained.trained.values()):
        np.testing.assert_array_equal(curve[:, 0], np.arange(1, 13))
        assert np.all(np.diff(curve[::3, 1]) < 0)
        assert curve[-1, 2] < 0.5 * curve[0, 2]


def test_training_tells_which_network_it_is_at(trained, told):
    assert told == [(name, done, 12) for name in ("C2S", "C2A") for done in (0, 6, 12)]


def test_the_forward_models_percent_is_that_of_its_predictions(
    trained, training_data, recording
):
    """Full range over the whole recording, error over the held-out part, in meters."""
    held_out = forward_samples(training_data.sensed, training_data.states).test
    predicted = np.asarray(trained.c2s.predict(held_out.inputs["configurations"], ()))
    ranges = np.ptp(recording.sensor("states").reshape(-1, 3, 6), axis=0)
    percent = 100 * np.abs(predicted - held_out.targets) / ranges
    assert trained.trained["C2S"].percent == pytest.approx(
        (percent.mean(), percent.std()), rel=1e-3
    )
    assert 0.5 < percent.mean() < 40


def predict_actions(c2a, samples) -> np.ndarray:
    """Normalized actions of a controller, without noise on its history."""
    past = np.moveaxis(
        np.asarray(
            c2a.sum_and_range.normalized(np.moveaxis(samples.inputs["actions"], -2, 0))
        ),
        0,
        -2,
    )
    return np.asarray(
        c2a(samples.inputs["desired"], History(samples.inputs["configurations"], past))
    )


def test_the_controllers_percent_is_that_of_its_actions_in_their_units(
    trained, training_data
):
    """Whatever scaling the network uses: computed here from meters."""
    split = controller_samples(
        training_data.sensed, training_data.actions, np.zeros((3, 3))
    )
    held_out = split.test
    c2a = trained.c2a
    predicted = np.asarray(c2a.sum_and_range.actions(predict_actions(c2a, held_out)))
    ranges = np.ptp(np.concatenate([part.targets for part in split.parts]), axis=0)
    percent = 100 * np.abs(predicted - held_out.targets) / ranges
    assert trained.trained["C2A"].percent == pytest.approx(
        (percent.mean(), percent.std()), rel=1e-3
    )
    assert 0.5 < percent.mean() < 25


def test_positions_share_one_scale_half_the_widest_extent():
    states = np.zeros((2, 2, 6), np.float32)
    states[0, 0, :3] = [-0.1, 0.0, 0.2]
    states[1, 1, :3] = [0.5, 0.3, 0.6]
    states[:, :, 5] = 1.0
    scaling = Scaling.of_states(states)
    np.testing.assert_allclose(scaling.half_range, [0.3, 0.3, 0.3, 1, 1, 1])
    np.testing.assert_allclose(scaling.center, [0.2, 0.15, 0.3, 0, 0, 0], atol=1e-7)


def test_the_same_key_trains_the_same_network_and_another_key_another(
    trained, tiny_recipe, training_data
):
    key = jax.random.split(jax.random.key(7))[0]
    again, other = (
        tiny_recipe.c2s.train(training_data, tiny_recipe.c2s_fit, k) for k in (key, KEY)
    )
    np.testing.assert_array_equal(again.curve, trained.trained["C2S"].curve)
    assert again.percent == trained.trained["C2S"].percent
    assert other.curve[0, 2] != pytest.approx(again.curve[0, 2], rel=1e-3)
