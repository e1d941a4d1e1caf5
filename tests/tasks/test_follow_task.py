"""A target moved by hand: worked by hand from docs/results/protocol.md.

The steps: 50 of the line, 480 of the wandering, 54 out (0.4298 m at 8 cm/s), 20
outside, 54 back, 40 at the end.
"""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.tasks import load_task

TWIN = load_arm("twin_arm")
FAST = TWIN.model_copy(update={"control_rate": 20.0})
BEGIN = [0.18, 0.0, 0.58 - 1.2 * 0.18**2]


@pytest.fixture(scope="module")
def task():
    return load_task("follow", TWIN)


@pytest.fixture(scope="module")
def path(task):
    return task.desired_positions()[:, -1]


@pytest.fixture(scope="module")
def inside(task):
    """Steps whose target is within reach."""
    return task.scores[1].steps


def test_a_hand_tells_nobody_where_it_goes(task):
    assert not task.foreseen


@pytest.mark.parametrize("step", [1, 25, 50])
def test_it_begins_with_a_line_from_rest_of_five_seconds(path, step):
    expected = np.array([0, 0, 0.6]) + step / 50 * (np.array(BEGIN) - [0, 0, 0.6])
    np.testing.assert_allclose(path[step - 1], expected, atol=1e-6)


def test_it_wanders_on_a_dome(path):
    seconds = np.array([0.1, 3, 6, 9, 12, 18, 48])
    x = [0.18 + 0.08 * np.sin(np.pi / 60), 0.26, 0.18, 0.10, 0.18, 0.18, 0.18]
    diagonal = 0.18 * 0.5**0.5
    y = [0.18 * np.sin(np.pi / 120), diagonal, 0.18, diagonal, 0, -0.18, 0]
    steps = np.round(10 * seconds).astype(int)
    expected = np.array([x, y, 0.58 - 1.2 * (np.square(x) + np.square(y))])
    np.testing.assert_allclose(path[49 + steps], expected.T, atol=1e-6)


def test_it_leaves_waits_comes_back_and_stays(path):
    steps = np.array([530, 531, 557, 584, 604, 605, 658, 698])
    shares = np.array([0, 1 / 54, 0.5, 1, 1, 53 / 54, 0, 0])
    expected = BEGIN + np.outer(shares, np.array([0.60, 0, 0.45]) - BEGIN)
    np.testing.assert_allclose(path[steps - 1], expected, atol=1e-6)


def test_it_is_never_faster_than_eight_centimeters_a_second(path):
    steps = np.diff(np.concatenate([[[0, 0, 0.6]], path]), axis=0)
    moves = np.linalg.norm(steps, axis=-1)
    assert moves.max() <= 0.008 + 1e-6
    np.testing.assert_allclose(moves[530:584], 0.008, rtol=0.01)


def test_the_target_is_out_of_reach_once_about_its_time_outside(inside):
    left, back = np.flatnonzero(np.diff(inside.astype(int)) != 0) + 1
    assert inside[:left].all()
    assert inside[back:].all()
    assert 530 < left < 584
    assert 604 < back < 658
    # out and back on the same line
    assert left - 530 == pytest.approx(658 - back, abs=1)


def test_the_waiting_position_is_out_of_reach(path, inside):
    """0.60 aside and 0.45 up are 0.75 m away."""
    assert np.linalg.norm(path[590]) > 0.6
    assert not inside[584:604].any()


def test_position_is_scored_within_reach_except_approach_and_recovery(task, inside):
    back = np.flatnonzero(inside[1:] & ~inside[:-1])[0] + 1
    expected = inside.copy()
    expected[:50] = False
    expected[back : back + 15] = False
    np.testing.assert_array_equal(task.scores[0].steps, expected)


def test_a_faster_control_keeps_the_times(path, monkeypatch):
    gaps = "s2c2a.tasks.lines.reach_gaps"
    monkeypatch.setattr(gaps, lambda arm, points: np.zeros(len(points)))
    fast = load_task("follow", FAST).desired_positions()[:, -1]
    np.testing.assert_allclose(fast[1 : 2 * 530 : 2], path[:530], atol=1e-6)
    assert len(fast) == 100 + 960 + 107 + 40 + 107 + 80
