"""Windows computed by hand: values encode episode and time."""

import numpy as np
import pytest

from s2c2a.data import controller_samples, forward_samples
from s2c2a.data.windows import APART, stretches
from s2c2a.errors import RecordingError

EPISODES, SAMPLES = 2, 100
STRETCHES = {
    "training": range(0, 65),
    "validation": range(70, 85),
    "test": range(85, 100),
}
NOW = {"training": range(0, 64), "validation": range(75, 84), "test": range(90, 99)}
"""Steps of the windows, which cross no border; before an episode the arm is at rest."""
NEUTRAL = np.array([[-1.0, -2.0, -3.0, -4.0]])


def encoded_values(*features: int) -> np.ndarray:
    """Arrays of 10000 (episode + 1) + 10 t + k, with k along the last axis."""
    episode = 10000.0 * np.arange(1, EPISODES + 1)[:, None]
    moment = 10.0 * np.arange(SAMPLES)
    start = (episode + moment).reshape(EPISODES, SAMPLES, *[1] * len(features))
    return start + np.broadcast_to(np.arange(features[-1]), (*[1] * 2, *features))


CONFIGURATIONS = encoded_values(1, 3)
ACTIONS = encoded_values(1, 4) + 0.5
STATES = encoded_values(1, 6) + 0.25


@pytest.fixture(params=STRETCHES)
def part(request):
    """Samples of one stretch and the moments of its windows."""
    return getattr(
        controller_samples(CONFIGURATIONS, ACTIONS, NEUTRAL), request.param
    ), list(NOW[request.param])


def expected(moments, features: int, offset: float = 0.0) -> np.ndarray:
    """Values of `encoded_values` at some steps, shape (episodes * steps, features)."""
    rows = [
        10000.0 * (episode + 1) + 10.0 * moment
        for episode in range(EPISODES)
        for moment in moments
    ]
    return np.array(rows)[:, None] + np.arange(features) + offset


def test_an_episode_of_100_samples_is_split_with_a_gap_after_its_training_samples():
    parts = [
        [list(range(100))[place] for _, place in part] for part in stretches([100])
    ]
    assert parts == [[list(moments)] for moments in STRETCHES.values()]


def rows_of(part) -> np.ndarray:
    """Samples that a part has of one long episode."""
    return np.concatenate([np.arange(place.start, place.stop) for _, place in part])


@pytest.mark.parametrize("samples", [50, 51, 77, 100, 500, 501])
def test_stretches_share_an_episode_without_overlap(samples):
    parts = [np.arange(samples)[part[0][1]] for part in stretches([samples])]
    assert (np.diff(np.concatenate(parts)) > 0).all()
    np.testing.assert_allclose(
        [len(part) for part in parts], np.array([0.65, 0.15, 0.15]) * samples, atol=1.0
    )


def test_no_sample_that_judges_is_within_25_of_a_training_sample():
    training, *others = map(rows_of, stretches([2000]))
    for part in others:
        assert np.abs(part[:, None] - training).min() >= 25


def test_validation_and_test_samples_may_be_25_apart_too():
    validation, test = map(rows_of, stretches([2000], APART)[1:])
    assert np.abs(validation[:, None] - test).min() >= 25


def test_parts_without_usable_samples_are_refused():
    """An episode of one step holds no window; unknown states are no samples."""
    with pytest.raises(RecordingError, match=r"49 usable samples.*at least 50"):
        forward_samples(CONFIGURATIONS[:1, :49], STATES[:1, :49])
    counts = (40, 40, 40, 40, 1, 40, 40)
    states = np.repeat(STATES[:1, :40], 7, axis=0)
    actions = np.repeat(ACTIONS[:1, :40], 7, axis=0)
    sensed = np.repeat(CONFIGURATIONS[:1, :40], 7, axis=0)
    with pytest.raises(RecordingError, match="usable samples cannot be split"):
        controller_samples(sensed, actions, NEUTRAL, counts)
    states[6] = np.nan
    with pytest.raises(RecordingError, match="usable samples cannot be split"):
        forward_samples(sensed, states)


def test_a_very_long_episode_is_split_piece_by_piece():
    parts = stretches([2063])
    assert [len(part) for part in parts] == [4, 4, 4]
    rows = np.concatenate([rows_of(part) for part in parts])
    assert rows.max() < 2063
    assert len(np.unique(rows)) == len(rows) > 0.9 * 2063


def test_short_episodes_belong_to_one_part_as_a_whole():
    parts = stretches([40] * 7)
    assert [sorted(episode for episode, _ in part) for part in parts] == [
        [0, 1, 2, 3, 5],
        [4],
        [6],
    ]
    assert all(place == slice(0, 40) for part in parts for _, place in part)


def test_samples_without_any_known_state_are_dropped_and_partial_ones_stay():
    states = STATES.copy()
    states[0, :10] = np.nan
    states[0, 10, :, 3:] = np.nan
    split = forward_samples(CONFIGURATIONS, states)
    assert len(split.training.targets) == 58 + 65
    assert np.isnan(split.training.targets[0, :, 3:]).all()


def test_padding_of_shorter_episodes_is_ignored():
    split = forward_samples(CONFIGURATIONS, STATES, lengths=(100, 60))
    rows = np.concatenate([part.targets[:, 0, 0] for part in split.parts])
    assert len(rows) == 95 + 57
    assert rows.max() < 10000.0 * 2 + 10.0 * 60


def test_the_shortest_episode_has_a_window_in_every_stretch():
    split = controller_samples(CONFIGURATIONS[:, :50], ACTIONS[:, :50], NEUTRAL)
    assert min(len(part.targets) for part in split.parts) >= EPISODES


def test_forward_samples_pair_sensed_configurations_with_simultaneous_states():
    split = forward_samples(CONFIGURATIONS, STATES)
    for name, moments in STRETCHES.items():
        samples = getattr(split, name)
        np.testing.assert_array_equal(
            samples.inputs["configurations"][:, 0], expected(moments, 3)
        )
        np.testing.assert_array_equal(samples.targets[:, 0], expected(moments, 6, 0.25))


def test_the_target_is_the_current_action_and_desired_is_the_next_configuration(
    part,
):
    samples, now = part
    np.testing.assert_array_equal(samples.targets[:, 0], expected(now, 4, 0.5))
    np.testing.assert_array_equal(
        samples.inputs["desired"][:, 0], expected([moment + 1 for moment in now], 3)
    )


@pytest.mark.parametrize("age", range(4))
def test_sensed_history_is_youngest_first_and_before_an_episode_its_first_value(
    part, age
):
    samples, now = part
    then = [max(moment - age, 0) for moment in now]
    np.testing.assert_array_equal(
        samples.inputs["configurations"][:, 0, age], expected(then, 3)
    )


@pytest.mark.parametrize("age", range(5))
def test_past_actions_begin_one_step_ago_and_before_an_episode_they_are_neutral(
    part, age
):
    samples, now = part
    then = np.array([moment - age - 1 for moment in now] * EPISODES)[:, None]
    desired = np.where(then >= 0, expected(then[: len(now), 0], 4, 0.5), NEUTRAL)
    np.testing.assert_array_equal(samples.inputs["actions"][:, 0, age], desired)
