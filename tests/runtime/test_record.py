"""Episodes from records of steps: one row a step, whatever single sensors do."""

import numpy as np
import pytest

from s2c2a.errors import RecordingError
from s2c2a.goals import Goal
from s2c2a.runtime import Loop, StepRecord, StepRequest, build_episode
from s2c2a.spaces import Reading, Stage

NAN = np.full((3, 3), np.nan)


@pytest.fixture
def step(twin):
    """Function that makes a record with chosen time and readings."""

    def make(
        number,
        stage=Stage.RUN,
        time=None,
        cables=None,
        diagnostics=None,
        goal=None,
        **others,
    ):
        cables = np.full((3, 3), float(number)) if cables is None else cables
        reading = Reading(
            0.1 * number if time is None else time, {"cables": cables} | others
        )
        return StepRecord(
            number,
            7.0 + 0.1 * number,
            stage,
            reading,
            goal,
            np.full((3, 3), 10.0 + number),
            diagnostics or {},
            0.01,
        )

    return make


def test_an_episode_has_a_row_a_step_and_a_column_a_quantity(step, twin):
    episode = build_episode([step(number) for number in range(5)], twin, task="circle")
    columns = {"time", "stage", "actions", "tick_time", "sensor.cables"}
    assert set(episode.columns) == columns
    times = [0.1 * number for number in range(5)]
    np.testing.assert_array_equal(episode["time"], times)
    np.testing.assert_array_equal(episode["actions"][:, 0, 0], [10, 11, 12, 13, 14])
    np.testing.assert_array_equal(episode.sensor("cables")[:, 0, 0], [0, 1, 2, 3, 4])
    np.testing.assert_array_equal(episode["stage"], [Stage.RUN] * 5)
    assert episode.options == {"task": "circle"}


def test_an_episode_needs_a_step(twin):
    with pytest.raises(RecordingError, match="no control step was done"):
        build_episode([], twin)


def test_diagnostics_of_some_steps_are_nan_in_the_others(step, twin):
    steps = [
        step(0, Stage.IDLE),
        step(1, diagnostics={"planned": np.ones((3, 3))}),
        step(2, Stage.HOLD),
    ]
    np.testing.assert_array_equal(
        build_episode(steps, twin)["planned"], [NAN, np.ones((3, 3)), NAN]
    )


def test_goals_have_columns_only_where_one_is_set(step, twin):
    goal = (
        Goal.of(3)
        .with_position([0.1, 0.0, 0.5])
        .with_obstacles([[0.3, 0.0, 0.4]], [0.1])
    )
    steps = [
        step(0, goal=goal),
        step(1, goal=Goal.of(3)),
        step(2, Stage.RELEASE, goal=goal),
    ]
    episode = build_episode(steps, twin)
    np.testing.assert_allclose(
        episode["desired_positions"][0], [*NAN[:2], [0.1, 0.0, 0.5]], rtol=1e-6
    )
    assert np.isnan(episode["desired_positions"][1:]).all()
    assert "desired_axes" not in episode.columns
    np.testing.assert_allclose(
        episode["obstacles"][:, 0], [[0.3, 0.0, 0.4, 0.1], [0] * 4, [0] * 4], rtol=1e-6
    )
    without = set(build_episode(steps[1:], twin).columns)
    assert without.isdisjoint({"desired_positions", "desired_axes", "obstacles"})


def test_a_sensor_that_is_missing_or_has_another_shape_is_nan_in_that_step(step, twin):
    """Also in the first steps."""
    words = np.array([["a"] * 3] * 3)
    invalid = [np.zeros((2, 3)), np.zeros(9), words, np.full((3, 3), None)]
    steps = [step(number, cables=cables) for number, cables in enumerate(invalid)]
    steps += [step(number) for number in range(4, 10)]
    steps[5] = StepRecord(5, 7.5, Stage.HOLD, Reading(0.5, {}), None, np.zeros((3, 3)))
    cables = build_episode(steps, twin).sensor("cables")
    assert cables.shape == (10, 3, 3)
    np.testing.assert_array_equal(
        np.isnan(cables).all(axis=(1, 2)), [True] * 4 + [False, True] + [False] * 4
    )


def test_a_sensor_without_numbers_does_not_affect_the_others(step, twin):
    episode = build_episode(
        [step(number, warmth=np.array("hot")) for number in range(3)], twin
    )
    np.testing.assert_array_equal(episode.sensor("cables")[:, 0, 0], [0, 1, 2])
    assert np.isnan(episode.sensor("warmth")).all()


@pytest.mark.parametrize("time", [np.nan, np.inf, 0.1, -5.0, 0.0])
def test_the_loops_clock_continues_where_a_reading_has_no_valid_time(step, twin, time):
    steps = [step(0), step(1), step(2, time=time), step(3, time=time), step(4)]
    np.testing.assert_allclose(
        build_episode(steps, twin)["time"], [0.0, 0.1, 0.2, 0.3, 0.4]
    )


def test_valid_times_are_kept_bit_for_bit(step, twin):
    times = np.cumsum(np.random.default_rng(0).uniform(0.05, 0.15, 20))
    episode = build_episode(
        [step(number, time=time) for number, time in enumerate(times)], twin
    )
    np.testing.assert_array_equal(episode["time"], times)


def test_faults_are_kept_with_the_episode(puppet, actor, clock, twin):
    def corrupt(reading):
        if 0.25 < reading.time < 0.55:
            return Reading(reading.time, {"cables": NAN})
        return reading

    loop = Loop(puppet, actor, clock, faults=corrupt)
    loop.open()
    episode = build_episode([loop.tick(StepRequest()) for _ in range(10)], twin)
    assert episode.options["faults"] == ["'cables' is not finite"]
    np.testing.assert_array_equal(
        episode["stage"], [Stage.RUN] * 3 + [Stage.HOLD] * 3 + [Stage.RUN] * 4
    )
    assert np.isnan(episode.sensor("cables")[3:6]).all()
    np.testing.assert_array_equal(
        episode.sensor("warmth"), [300.0] * 3 + [np.nan] * 3 + [300.0] * 4
    )
