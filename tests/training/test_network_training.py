"""Training the two networks of the paper, tiny and short, on the small recording."""

import jax
import numpy as np
import pytest

from s2c2a.data import Samples, Split, controller_samples, forward_samples
from s2c2a.errors import TrainingError
from s2c2a.networks import History
from s2c2a.sensing import estimator_for
from s2c2a.training import FitOptions, train_c2a, train_c2s
from s2c2a.training.networks import NetworkSize, length_scale, state_scaling

KEY, SIZE = jax.random.key(1), NetworkSize(layers=1, hidden=8)
SHORT = FitOptions(learning_rate=1e-2, most_epochs=12, epochs_per_call=6)
FROZEN = FitOptions(learning_rate=0.0, most_epochs=2, epochs_per_call=2)


@pytest.fixture(scope="module")
def sensed(recording):
    return np.asarray(estimator_for(recording.arm)(recording.cables, recording.configurations))


@pytest.fixture(scope="module")
def forward_split(recording, sensed):
    return forward_samples(sensed, recording.states)


@pytest.fixture(scope="module")
def control_split(recording, sensed):
    return controller_samples(sensed, recording.actions)


@pytest.fixture(scope="module")
def c2s(forward_split):
    return train_c2s(forward_split, SIZE, SHORT, KEY)


@pytest.fixture(scope="module")
def c2a(control_split, recording):
    return train_c2a(control_split, recording.arm, SIZE, 0.05, SHORT, KEY)


def test_training_the_forward_model_lowers_its_loss(c2s):
    assert c2s.curve.shape == (12, 3)
    assert np.all(np.diff(c2s.curve[::3, 1]) < 0)
    assert c2s.curve[-1, 2] < 0.5 * c2s.curve[0, 2]


def test_training_the_controller_lowers_its_loss(c2a):
    assert np.all(np.diff(c2a.curve[::3, 1]) < 0)
    assert c2a.curve[-1, 2] < 0.5 * c2a.curve[0, 2]


def test_the_forward_models_percent_is_that_of_its_predictions(c2s, forward_split, recording):
    """Full range over the whole recording, error over the held-out part, in metres."""
    held_out = forward_split.test
    predicted = np.asarray(c2s.network.predict(held_out.inputs["configurations"], ()))
    ranges = np.ptp(recording.states.reshape(-1, 3, 6), axis=0)
    percent = 100 * np.abs(predicted - held_out.targets) / ranges
    assert c2s.percent == pytest.approx((percent.mean(), percent.std()), rel=1e-3)
    assert 0.5 < c2s.percent[0] < 40


def test_the_controllers_percent_is_that_of_its_actions_in_their_units(c2a, control_split, recording):
    """Whatever scaling the network uses: computed here from metres."""
    held_out, layer = control_split.test, c2a.network.sum_and_range
    past = np.moveaxis(np.asarray(layer.normalised(np.moveaxis(held_out.inputs["actions"], -2, 0))), 0, -2)
    history = History(held_out.inputs["configurations"], past)
    predicted = np.asarray(layer.actions(c2a.network(held_out.inputs["wanted"], history)))
    parts = (control_split.training, control_split.validation, control_split.test)
    ranges = np.ptp(np.concatenate([part.targets for part in parts]), axis=0)
    percent = 100 * np.abs(predicted - held_out.targets) / ranges
    assert c2a.percent == pytest.approx((percent.mean(), percent.std()), rel=1e-3)
    assert 0.5 < c2a.percent[0] < 25


def test_training_leaves_the_scalings_as_the_data_set_them(c2s, c2a, forward_split, control_split, recording):
    configurations = forward_split.training.inputs["configurations"].reshape(-1, 3)
    scaling = c2s.network.configuration_scaling
    np.testing.assert_allclose(scaling.centre - scaling.half_range, configurations.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(scaling.centre + scaling.half_range, configurations.max(axis=0), atol=1e-6)
    expected = state_scaling(forward_split.training.targets)
    np.testing.assert_array_equal(c2s.network.state_scaling.half_range, expected.half_range)
    np.testing.assert_array_equal(c2s.network.state_scaling.centre, expected.centre)
    wanted = control_split.training.inputs["wanted"].reshape(-1, 3)
    np.testing.assert_allclose(c2a.network.configuration_scaling.half_range, np.ptp(wanted, axis=0) / 2, atol=1e-6)
    np.testing.assert_array_equal(c2a.network.sum_and_range.neutral, np.zeros((3, 3)))


def test_positions_share_one_scale_half_the_widest_extent():
    states = np.zeros((2, 2, 6), np.float32)
    states[0, 0, :3], states[1, 1, :3], states[:, :, 5] = [-0.1, 0.0, 0.2], [0.5, 0.3, 0.6], 1.0
    assert length_scale(states) == pytest.approx(0.3)
    scaling = state_scaling(states)
    np.testing.assert_allclose(scaling.half_range, [0.3, 0.3, 0.3, 1, 1, 1])
    np.testing.assert_allclose(scaling.centre, [0.2, 0.15, 0.3, 0, 0, 0], atol=1e-7)


def test_noise_on_the_history_is_used_in_training_and_nowhere_else(control_split, recording):
    """Weights that do not move: only what the loss of training sees can differ."""
    calm, noisy = (train_c2a(control_split, recording.arm, SIZE, noise, FROZEN, KEY) for noise in (0.0, 30.0))
    assert np.all(np.abs(noisy.curve[:, 1] - calm.curve[:, 1]) > 0.01 * calm.curve[:, 1])
    np.testing.assert_array_equal(noisy.curve[:, 2], calm.curve[:, 2])
    assert noisy.percent == calm.percent


def test_noise_falls_on_past_actions_and_on_nothing_else(control_split, recording):
    """A network that cannot see past actions trains to the same loss with noise and without."""
    blind = [train_c2a(_without_actions(control_split), recording.arm, SIZE, n, FROZEN, KEY).curve for n in (0.0, 0.0)]
    np.testing.assert_array_equal(*blind)


def _without_actions(split: Split) -> Split:
    parts = (split.training, split.validation, split.test)
    return Split(*(Samples(p.inputs | {"actions": 0 * p.inputs["actions"]}, p.targets) for p in parts))


def test_the_same_key_trains_the_same_networks(c2s, forward_split):
    again = train_c2s(forward_split, SIZE, SHORT, KEY)
    np.testing.assert_array_equal(again.curve, c2s.curve)
    assert again.percent == c2s.percent


def test_another_key_begins_with_other_weights(forward_split, c2s):
    other = train_c2s(forward_split, SIZE, FitOptions(1e-2, most_epochs=1, epochs_per_call=1), jax.random.key(2))
    assert other.curve[0, 2] != pytest.approx(c2s.curve[0, 2], rel=1e-3)


def test_too_few_samples_are_refused(recording, sensed):
    few = forward_samples(sensed[:1, :60], recording.states[:1, :60])
    with pytest.raises(TrainingError, match="42 training samples"):
        train_c2s(few, SIZE, SHORT, KEY)
    few = controller_samples(sensed[:1, :60], recording.actions[:1, :60])
    with pytest.raises(TrainingError, match="41 training samples"):
        train_c2a(few, recording.arm, SIZE, 0.05, SHORT, KEY)
