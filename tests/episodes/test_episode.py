"""The container of what an arm did: what it refuses, and what its columns mean."""

import numpy as np
import pytest

from s2c2a.episodes import Episode
from s2c2a.episodes.episode import stacked
from s2c2a.errors import RecordingError
from s2c2a.spaces import Stage

STEPS = 6
TIME = 0.1 * np.arange(STEPS)
ZEROS = np.zeros((STEPS, 3, 3))


@pytest.fixture
def made(twin):
    """Makes an episode of a few steps; `changes` are columns, None leaves one out."""

    def make(options=None, **changes):
        columns = {"time": TIME, "actions": ZEROS, "sensor.cables": 1.0 + ZEROS}
        for name, values in changes.items():
            columns[name.replace("__", ".")] = values
            if values is None:
                del columns[name]
        return Episode(twin, columns, options or {})

    return make


def test_an_episode_has_a_length_sensors_and_columns(made):
    episode = made(sensor__states=np.zeros((STEPS, 3, 6)))
    assert len(episode) == STEPS
    assert episode.sensors == ["cables", "states"]
    np.testing.assert_array_equal(episode.sensor("cables"), 1.0)
    assert episode.get("planned") is None


def test_a_missing_column_is_reported_with_the_existing_ones(made):
    told = r"no 'sensor.flex'; it has time, actions, sensor.cables"
    with pytest.raises(RecordingError, match=told):
        made().sensor("flex")


NO_NUMBERS = "not numbers for every step"
REFUSED = {
    "no time": ({"time": None}, "needs time; it has actions"),
    "no actions": ({"actions": None}, "needs actions"),
    "columns of different lengths": ({"planned": ZEROS[1:]}, "as many steps"),
    "actions of another arm": (
        {"actions": np.zeros((STEPS, 3, 4))},
        r"'actions' is of shape \(3, 4\) a step.*\(3, 3\)",
    ),
    "states without axes": (
        {"sensor__states": ZEROS},
        r"'sensor.states' is of shape \(3, 3\)",
    ),
    "flat configurations": (
        {"sensor__configurations": np.zeros((STEPS, 9))},
        "'sensor.configurations'",
    ),
    "a sensed column of another shape": ({"sensed": ZEROS[:, 0]}, "'sensed'"),
    "a plan of another shape": ({"planned": ZEROS[:, :2]}, "'planned'"),
    "a prediction of another shape": ({"predicted": ZEROS}, "'predicted'"),
    "targets of another shape": (
        {"desired_positions": ZEROS[:, 0]},
        "'desired_positions'",
    ),
    "stages that are no numbers": ({"stage": ZEROS[:, 0, :2]}, "'stage'"),
    "actions that are not finite": (
        {"actions": np.nan * ZEROS},
        "'actions' holds numbers that are not",
    ),
    "a time that is not finite": (
        {"time": np.array([0, 1, 2, np.inf, 4, 5])},
        "'time' holds numbers that are not finite",
    ),
    "a time that stands": ({"time": TIME[[0, 1, 1, 2, 3, 4]]}, "must rise"),
    "words": ({"note": np.array(["a"] * STEPS)}, NO_NUMBERS),
    "objects": ({"note": np.array([None] * STEPS)}, NO_NUMBERS),
    "complex numbers": ({"note": np.zeros(STEPS, complex)}, NO_NUMBERS),
    "more digits than a file keeps": ({"note": np.longdouble(TIME)}, NO_NUMBERS),
    "one number for all": ({"note": np.float64(3)}, NO_NUMBERS),
    "ragged rows": ({"note": [[1.0], [1.0, 2.0]] * 3}, NO_NUMBERS),
}


@pytest.mark.parametrize(("changes", "said"), REFUSED.values(), ids=REFUSED)
def test_invalid_episodes_are_rejected_with_a_message(made, changes, said):
    with pytest.raises(RecordingError, match=said):
        made(**changes)


def test_hundreds_of_columns_are_refused(made):
    with pytest.raises(RecordingError, match="at most 256"):
        made(**{f"column{number}": TIME for number in range(300)})


def test_other_sensors_may_have_any_shape_and_hold_nan(made):
    episode = made(sensor__flex=np.full((STEPS, 2, 5, 7), np.nan), sensor__warmth=TIME)
    assert episode.sensor("flex").shape == (STEPS, 2, 5, 7)


def test_columns_are_read_only_and_the_callers_arrays_are_not(made):
    mine = np.zeros((STEPS, 3, 3))
    episode = made(planned=mine)
    with pytest.raises(ValueError, match="read-only"):
        episode["planned"][0] = 1.0
    mine[0] = 1.0


STAGES = np.array(
    [Stage.START, Stage.RUN, Stage.HOLD, Stage.RUN, Stage.RELEASE, Stage.IDLE], np.int8
)


def test_a_run_is_its_run_and_hold_stages_and_results_are_one_step_later(made):
    states = np.zeros((STEPS, 3, 6))
    states[:, 0, 0] = np.arange(STEPS)
    episode = made(stage=STAGES, sensor__states=states)
    np.testing.assert_array_equal(episode.running, [1, 2, 3])
    np.testing.assert_array_equal(episode.after("states")[:, 0, 0], [2, 3, 4])
    np.testing.assert_allclose(episode.times(), [0.2, 0.3, 0.4])
    np.testing.assert_allclose(episode.ran("time"), [0.1, 0.2, 0.3])


def test_without_stages_all_steps_are_the_run_and_the_last_has_no_result(made):
    episode = made()
    assert len(episode.running) == STEPS
    with pytest.raises(RecordingError, match="nothing was read after the last action"):
        episode.after("cables")


def test_with_options_adds_options_to_a_copy(made):
    first = made({"seed": 1})
    second = first.with_options(task="circle", seed=2)
    assert first.options == {"seed": 1}
    assert second.options == {"seed": 2, "task": "circle"}


def test_stacking_repeats_last_rows_and_rejects_different_shapes(made):
    def of(steps, shape):
        times, actions = TIME[:steps], ZEROS[:steps]
        columns = {"sensor__cables": actions, "sensor__other": np.zeros(shape)}
        return made(time=times, actions=actions, **columns)

    short, longer = of(3, (3, 2)), of(4, (4, 1))
    assert stacked([made(), made()], "actions").shape == (2, STEPS, 3, 3)
    expected = [TIME[:4], [*TIME[:3], TIME[2]]]
    np.testing.assert_array_equal(stacked([longer, short], "time"), expected)
    with pytest.raises(RecordingError, match="has shapes"):
        stacked([longer, short], "sensor.other")
