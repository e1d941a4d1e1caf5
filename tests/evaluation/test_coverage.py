"""Coverage of recordings: bends of neighbors, speeds, and shares that are reached."""

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.episodes import Episode
from s2c2a.errors import ReadingError
from s2c2a.evaluation.coverage import RANDOM_SHAPES, Coverage
from s2c2a.kinematics import PCC, states_from_bends
from s2c2a.paper import disc_points


@pytest.fixture
def recorded(make_arm):
    """An episode of an arm whose encoders and tracker report given bends [rad]."""

    def make(bends, times=None, states=True) -> Episode:
        bends = np.asarray(bends, float)
        arm = make_arm(bends.shape[1])
        cables = np.asarray(PCC.of(arm).actions(jnp.asarray(bends, jnp.float32)))
        steps = np.arange(len(bends)) / arm.control_rate
        columns = {
            "time": steps if times is None else times,
            "actions": cables,
            "sensor.cables": cables,
        }
        if states:
            lengths = jnp.asarray(ArmGeometry.of(arm).lengths)
            reached = states_from_bends(jnp.asarray(bends), lengths)
            columns["sensor.states"] = np.asarray(reached)
        return Episode(arm, columns)

    return make


@pytest.mark.slow
def test_equal_bends_are_equal_and_an_s_shape_is_negative(recorded):
    c_shape = [[0.3, 0.4], [0.3, 0.4]]
    s_shape = [[-0.3, -0.4], [0.3, 0.4]]
    across = [[-0.4, 0.3], [0.3, 0.4]]
    coverage = Coverage.of([recorded([c_shape, s_shape, across])])
    along, outer = coverage.neighboring_bends(0)
    np.testing.assert_allclose(along, [0.5, -0.5, 0.0], atol=1e-5)
    np.testing.assert_allclose(outer, 0.5, atol=1e-5)
    assert coverage.opposed_share(0) == 0.5


def test_speeds_are_those_of_the_fastest_module_within_each_episode(recorded):
    bends = np.zeros((3, 2, 2))
    bends[1:, 1, 0] = 0.1
    episodes = [
        recorded(bends, times=np.array([0.0, 0.5, 1.0])),
        recorded(bends + 0.2, times=np.array([0.0, 0.5, 1.0])),
    ]
    coverage = Coverage.of(episodes)
    np.testing.assert_allclose(coverage.speeds, [0.2, 0.0, 0.2, 0.0], atol=1e-5)


def test_more_random_shapes_reach_more(recorded, make_arm):
    limits = ArmGeometry.of(make_arm(2)).bend_limits
    points = disc_points(np.random.default_rng(1), (RANDOM_SHAPES, 2))
    bends = limits[:, None] * points
    few = Coverage.of([recorded(bends[:20])])
    many = Coverage.of([recorded(bends)])
    for share in (Coverage.reached_bends, Coverage.reached_tips):
        assert 0.0 < share(few) < share(many) <= 1.0
    single = slice(0, 1)
    assert few.reached_bends(single) > few.reached_bends()


def test_without_tracking_the_bends_are_known_and_the_workspace_is_not(recorded):
    coverage = Coverage.of([recorded(np.full((4, 2, 2), 0.1), states=False)])
    assert len(coverage.bends) == 4
    assert np.isnan(coverage.reached_tips())


def test_missing_measurements_do_not_count(recorded):
    episode = recorded(np.full((4, 2, 2), 0.1))
    states = np.array(episode.sensor("states"))
    states[1] = np.nan
    cables = np.array(episode.sensor("cables"))
    cables[2] = np.nan
    columns = {"sensor.states": states, "sensor.cables": cables}
    coverage = Coverage.of([Episode(episode.arm, {**episode.columns, **columns})])
    assert len(coverage.bends) == 3
    assert len(coverage.tips) == 3
    assert len(coverage.speeds) == 1


def test_a_recording_without_sensors_has_no_coverage(make_arm):
    columns = {"time": np.arange(3.0), "actions": np.zeros((3, 2, 3))}
    with pytest.raises(ReadingError, match="cables"):
        Coverage.of([Episode(make_arm(2), columns)])
