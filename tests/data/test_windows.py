"""Windows worked by hand: every number tells from which episode and which moment it comes."""

import numpy as np
import pytest

from s2c2a.data import controller_samples, forward_samples
from s2c2a.data.windows import stretches

EPISODES, SAMPLES = 2, 20
STRETCHES = {"training": range(0, 14), "validation": range(14, 17), "test": range(17, 20)}


def telling(*features: int) -> np.ndarray:
    """Arrays whose numbers are 1000 (episode + 1) + 10 t + k, the same for all but the last axis."""
    episode = 1000.0 * np.arange(1, EPISODES + 1)[:, None]
    moment = 10.0 * np.arange(SAMPLES)
    start = (episode + moment).reshape(EPISODES, SAMPLES, *[1] * len(features))
    return start + np.broadcast_to(np.arange(features[-1]), (*[1] * 2, *features))


CONFIGURATIONS, ACTIONS, STATES = telling(1, 3), telling(1, 4) + 0.5, telling(1, 6) + 0.25


@pytest.fixture(params=STRETCHES)
def part(request):
    """Samples of one stretch and the moments that it holds."""
    return getattr(controller_samples(CONFIGURATIONS, ACTIONS), request.param), STRETCHES[request.param]


def expected(moments: list[int], features: int, offset: float = 0.0) -> np.ndarray:
    """What `telling` holds at these moments, both episodes in turn, shape (episodes * moments, features)."""
    rows = [1000.0 * (episode + 1) + 10.0 * moment for episode in range(EPISODES) for moment in moments]
    return np.array(rows)[:, None] + np.arange(features) + offset


def test_an_episode_of_twenty_is_cut_after_fourteen_and_seventeen():
    assert [list(range(20))[part] for part in stretches(20)] == [list(moments) for moments in STRETCHES.values()]


@pytest.mark.parametrize("samples", [1, 2, 7, 100, 500, 501])
def test_stretches_share_an_episode_70_15_15_without_gap_or_overlap(samples):
    parts = [np.arange(samples)[part] for part in stretches(samples)]
    np.testing.assert_array_equal(np.concatenate(parts), np.arange(samples))
    np.testing.assert_allclose([len(part) for part in parts], np.array([0.7, 0.15, 0.15]) * samples, atol=1.0)


def test_five_hundred_samples_are_split_350_75_75():
    assert [part.stop - part.start for part in stretches(500)] == [350, 75, 75]


def test_forward_samples_pair_what_was_sensed_with_the_state_of_the_same_moment():
    split = forward_samples(CONFIGURATIONS, STATES)
    for name, moments in STRETCHES.items():
        samples = getattr(split, name)
        np.testing.assert_array_equal(samples.inputs["configurations"][:, 0], expected(list(moments), 3))
        np.testing.assert_array_equal(samples.targets[:, 0], expected(list(moments), 6, 0.25))


def test_the_target_is_the_action_of_the_moment_and_the_wanted_configuration_comes_next(part):
    samples, moments = part
    now = list(moments)[:-1]
    np.testing.assert_array_equal(samples.targets[:, 0], expected(now, 4, 0.5))
    np.testing.assert_array_equal(samples.inputs["wanted"][:, 0], expected([moment + 1 for moment in now], 3))


@pytest.mark.parametrize("age", range(4))
def test_sensed_history_is_youngest_first_and_never_from_before_the_stretch(part, age):
    samples, moments = part
    then = [max(moment - age, moments[0]) for moment in list(moments)[:-1]]
    np.testing.assert_array_equal(samples.inputs["configurations"][:, 0, age], expected(then, 3))


@pytest.mark.parametrize("age", range(5))
def test_past_actions_begin_one_step_ago_and_never_before_the_stretch(part, age):
    samples, moments = part
    then = [max(moment - age - 1, moments[0]) for moment in list(moments)[:-1]]
    np.testing.assert_array_equal(samples.inputs["actions"][:, 0, age], expected(then, 4, 0.5))


def test_one_window_worked_in_full():
    """Episode two, t = 3: wanted C_4; sensed C_3 C_2 C_1 C_0; sent A_2 A_1 A_0 and twice again A_0; target A_3."""
    samples, row = controller_samples(CONFIGURATIONS, ACTIONS).training, 13 + 3
    np.testing.assert_array_equal(samples.inputs["wanted"][row, 0], [2040, 2041, 2042])
    np.testing.assert_array_equal(samples.inputs["configurations"][row, 0, :, 0], [2030, 2020, 2010, 2000])
    np.testing.assert_array_equal(samples.inputs["actions"][row, 0, :, 0], [2020.5, 2010.5, 2000.5, 2000.5, 2000.5])
    np.testing.assert_array_equal(samples.targets[row, 0], [2030.5, 2031.5, 2032.5, 2033.5])


def test_shapes_hold_for_any_arm(recording):
    episodes, samples, modules, cables = recording.actions.shape
    training = controller_samples(recording.configurations, recording.actions).training
    rows = episodes * (round(0.7 * samples) - 1)
    assert training.inputs["wanted"].shape == (rows, modules, 3)
    assert training.inputs["configurations"].shape == (rows, modules, 4, 3)
    assert training.inputs["actions"].shape == (rows, modules, 5, cables)
    assert training.targets.shape == (rows, modules, cables)
    assert {values.dtype for values in (training.targets, *training.inputs.values())} == {np.dtype(np.float32)}
