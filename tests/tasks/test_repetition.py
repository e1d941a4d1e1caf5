"""Iterative learning control: offsets of a repeated task, from what a camera saw."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import position_errors, repeated_rollout
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import STRATEGIES, RunOptions, recipe_named
from s2c2a.tasks import load_task
from s2c2a.tasks.repetition import (
    LEARNING_GAIN,
    MAX_OFFSET,
    end_sensor,
    learned_offsets,
    moved_task,
    with_true_targets,
)

PERIOD = 0.1
STEPS = 200
AGE = 0.15


def seen_episode(arm, task, error, every=2, lost=()):
    """An episode whose tip is off by `error` [m], seen late and at a lower rate."""
    rows = STEPS + 1
    times = PERIOD * np.arange(rows)
    targets = np.full((rows, 3, 3), np.nan)
    targets[:STEPS] = task.desired_positions()
    true_times = PERIOD * np.arange(1, rows)
    seen = [row for row in range(0, rows, every) if row not in lost]
    ends = np.full((rows, 3, 3), np.nan)
    for k in range(3):
        tip = np.interp(times - AGE, true_times, targets[:STEPS, -1, k])
        ends[seen, -1, k] = tip[seen] - error[k]
    columns = {
        "time": times,
        "actions": np.zeros((rows, 3, arm.cable_count)),
        "stage": np.r_[np.full(STEPS, 2), 0].astype(np.int8),
        "desired_positions": targets,
        "sensor.camera_positions": ends,
        "sensor.camera_age": np.full(rows, AGE),
    }
    return Episode(arm, columns)


def test_offsets_are_the_measured_errors_times_the_gain(twin):
    task = load_task("circle", twin)
    error = np.array([0.01, -0.02, 0.005])
    episode = seen_episode(twin, task, error, lost=range(40, 60))
    offsets = learned_offsets(episode, np.zeros((STEPS, 3, 3)), "camera_positions")
    expected = np.tile(LEARNING_GAIN * error, (STEPS, 1))
    np.testing.assert_allclose(offsets[:, -1], expected, atol=1e-6)
    np.testing.assert_array_equal(offsets[:, :2], 0.0)


def test_offsets_are_limited(twin):
    task = load_task("circle", twin)
    episode = seen_episode(twin, task, np.array([10.0, 0.0, 0.0]))
    offsets = learned_offsets(episode, np.zeros((STEPS, 3, 3)), "camera_positions")
    longest = np.linalg.norm(offsets, axis=-1).max()
    assert longest == pytest.approx(MAX_OFFSET * twin.length)


def test_offsets_stay_where_nothing_was_seen(twin):
    task = load_task("circle", twin)
    episode = seen_episode(twin, task, np.zeros(3), lost=range(STEPS + 1))
    before = np.full((STEPS, 3, 3), 0.01)
    after = learned_offsets(episode, before, "camera_positions")
    np.testing.assert_allclose(after, before)


def test_an_episode_shows_the_targets_of_the_task(twin):
    task = load_task("circle", twin)
    offsets = np.full((STEPS, 3, 3), 0.02)
    moved = moved_task(task, offsets)
    true = task.desired_positions()
    np.testing.assert_allclose(moved.desired_positions(), true + 0.02, atol=1e-6)
    episode = with_true_targets(seen_episode(twin, moved, np.zeros(3)), task, offsets)
    np.testing.assert_allclose(episode.ran("desired_positions"), true)
    np.testing.assert_allclose(episode.ran("target_offsets"), offsets)


def test_an_arm_without_a_view_of_its_tip_cannot_learn(twin):
    with pytest.raises(S2C2AError, match=r"no sensor.*\[sensors.camera\]"):
        end_sensor(SimulatedRobot(twin))


@pytest.fixture
def watched(twin):
    """An arm that a camera sees, and a strategy for it."""
    arm = twin.model_copy(update={"sensors": Sensors(camera=Camera())})
    recipe = recipe_named("best")
    strategy = STRATEGIES.named("pcc")().build(arm, recipe, None, RunOptions())
    return arm, strategy


@pytest.mark.slow
def test_repetitions_lower_the_error_of_any_strategy(watched):
    arm, strategy = watched
    task = load_task("circle", arm)
    episodes = repeated_rollout(SimulatedRobot(arm), strategy, task, 3)
    errors = [
        position_errors(episode.after("states"), task.desired_positions()).mean()
        for episode in episodes
    ]
    assert len(episodes) == 3
    assert errors[0] > 2.0
    assert errors[-1] < 0.5 * errors[0]
    assert all(episode["time"][0] == 0.0 for episode in episodes)


def test_an_interrupted_repetition_hands_over_those_before_it(watched):
    arm, strategy = watched
    task = load_task("circle", arm)
    task = replace(task, goals=task.goals[:6], scores=())
    kept = []

    def fail(done, total):
        if done == 6 + 3:
            raise S2C2AError("no power")

    with pytest.raises(S2C2AError, match="no power"):
        repeated_rollout(SimulatedRobot(arm), strategy, task, 2, fail, keep=kept.append)
    whole, part = kept
    assert len(whole.running) == 6
    assert len(part) == 3
    assert "interrupted" not in whole.options
