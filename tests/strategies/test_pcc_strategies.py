"""PCC strategies: ideal arms, targets out of reach, and gains worked by hand."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, Cable, Motor
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError
from s2c2a.evaluation import position_errors, rollout
from s2c2a.evaluation.metrics import angles_deg
from s2c2a.kinematics import PCC, states_from_bends
from s2c2a.planning import PAPER, Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import RunOptions, fitted_gains, pcc_strategy, recipe_named
from s2c2a.strategies.pcc import FittedPCC
from s2c2a.tasks import load_task

PATH = 0.5 + 0.5 * np.sin(np.linspace(0, 20, 60)[:, None] + np.arange(6))


@pytest.fixture(scope="module")
def ideal(twin):
    """The twin with cables that neither stretch nor rub, without gravity: an arm as PCC says."""
    modules = tuple(
        module.model_copy(update={"cable": Cable(stiffness=1e6)})
        for module in twin.modules
    )
    changes = {
        "gravity_direction": (0.0, 0.0, 0.0),
        "motor": Motor(noise_ticks=0.0),
        "modules": modules,
    }
    return twin.model_copy(update={"name": "ideal", **changes})


@pytest.fixture(scope="module")
def pcc(ideal):
    """PCC in the planner and behind it, for the ideal arm."""
    return pcc_strategy(ideal, PAPER)


def towards(pcc, target):
    """States, actions and plans of the ideal arm in 60 steps towards a target."""
    robot = SimulatedRobot(pcc.arm)
    reading = robot.open()
    pcc.start(reading)
    plans = [pcc.diagnostics()["planned"]]
    states = []
    actions = []
    for _ in range(60):
        actions.append(pcc.step(reading, Goal.of(3).with_position(target)))
        robot.step(actions[-1])
        reading = robot.read()
        states.append(reading["states"])
        plans.append(pcc.diagnostics()["planned"])
    return np.array(states), np.array(actions), np.array(plans)


def recorded(arm, cables, states, options=None) -> Recording:
    """A recording of these cables and states, shape (episodes, samples, ...)."""
    episodes = [
        Episode(
            arm,
            {
                "time": np.arange(len(one)),
                "actions": one,
                "sensor.cables": one,
                "sensor.states": true,
            },
        )
        for one, true in zip(cables, states, strict=True)
    ]
    return Recording(arm, options or {"episodes": len(episodes)}, tuple(episodes))


def synthetic(arm, gains) -> Recording:
    """A recording of an arm whose modules bend by a gain times what their cables say."""
    bends = 0.6 * (PATH.reshape(2, 30, 3, 2) - 0.5)
    cables = np.asarray(PCC.of(arm).actions(jnp.asarray(bends, jnp.float32)), float)
    true = jnp.asarray(bends * np.asarray(gains)[:, None], jnp.float32)
    states = np.asarray(
        states_from_bends(true, jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32))
    )
    return recorded(arm, cables, states)


def test_pcc_follows_the_circle_on_an_arm_as_pcc_says(ideal, pcc):
    circle_run = rollout(SimulatedRobot(ideal), pcc, load_task("circle", ideal))
    errors = position_errors(
        circle_run.after("states"), circle_run.ran("desired_positions")
    )
    assert errors.mean() < 1.0
    assert errors.max() < 2.0
    # what is planned is what happens
    configurations = circle_run.after("configurations")
    np.testing.assert_allclose(configurations, circle_run.ran("planned"), atol=0.01)
    np.testing.assert_allclose(
        circle_run.ran("sensed")[1:], configurations[:-1], atol=0.01
    )


@pytest.mark.parametrize(
    "target", [[5.0, 0.0, 0.0], [0.0, 0.0, 100.0], [0.0, 0.0, -3.0], [0.0, 0.0, 0.0]]
)
def test_an_unreachable_target_stays_finite_and_within_the_limits(ideal, pcc, target):
    geometry = ArmGeometry.of(ideal)
    states, actions, plans = towards(pcc, target)
    assert (actions >= geometry.action_low - 1e-6).all()
    assert (actions <= geometry.action_high + 1e-6).all()
    assert np.isfinite(states).all()
    assert np.linalg.norm(states[..., :3], axis=-1).max() <= ideal.length * 1.01
    np.testing.assert_allclose(np.linalg.norm(plans[-1], axis=-1), 1.0, atol=1e-4)
    assert (np.arccos(plans[-1, :, 2]) <= geometry.bend_limits + 1e-3).all()


def test_a_target_out_of_reach_draws_the_arm_to_its_side_as_fast_as_the_arms_limit_and_no_faster(
    ideal, pcc
):
    states, _, plans = towards(pcc, [0.0, 5.0, 0.2])
    turns = angles_deg(plans[:-1], plans[1:])
    assert 0.98 * ideal.step_limit_deg < turns.max() < 1.001 * ideal.step_limit_deg
    tip = states[-1, -1, :3]
    assert tip[1] > 0.35
    assert abs(tip[0]) < 0.05


def test_pcc_does_not_listen_to_the_arm(ideal, pcc):
    """No feedback: the same goals lead to the same actions, whatever the readings."""
    goals = load_task("circle", ideal).goals[:15]
    rest = SimulatedRobot(ideal).open()
    actions = []
    for bend in (0.0, 0.01):
        pcc.start(rest)
        reading = Reading(
            0.1, {"cables": rest["cables"] + bend * np.array([-1, 0.5, 0.5])}
        )
        actions.append([pcc.step(reading, goal) for goal in goals])
    np.testing.assert_array_equal(*actions)


def test_a_fitted_strategy_asks_for_more_where_the_arm_gives_less(twin):
    """With gains of 0.8 its actions are those of the plain one divided by 0.8."""
    plain = pcc_strategy(twin, PAPER)
    recipe = recipe_named("paper")
    gains = FittedPCC().train(synthetic(twin, [0.8] * 3), recipe, seed=0)
    fitted = FittedPCC().build(twin, recipe, gains, RunOptions())
    assert (plain.name, fitted.name) == ("pcc", "pcc-fitted")
    goal = Goal.of(3).with_position([0.2, 0.05, 0.5])
    rest = Reading(0.0, {"cables": np.zeros((3, 3))})
    for strategy in (plain, fitted):
        strategy.start(rest)
    for _ in range(5):
        one, two = (strategy.step(rest, goal) for strategy in (plain, fitted))
    assert np.abs(one).max() > 1e-3
    np.testing.assert_allclose(two, one / 0.8, atol=1e-6)
    far = [
        fitted.step(rest, Goal.of(3).with_position([5.0, 0.0, 0.2])) for _ in range(30)
    ]
    assert np.max(np.abs(far) / ArmGeometry.of(twin).action_high) == pytest.approx(
        1.0, abs=1e-6
    )


def test_gains_are_not_fitted_to_a_recording_cut_short(twin):
    """Staged babbling cut short knows only its first stages."""
    with pytest.raises(RecordingError, match="2 of 18 episodes"):
        fitted_gains(replace(synthetic(twin, [1.0] * 3), options={"episodes": 18}))


def test_gains_cannot_be_fitted_without_true_states(twin):
    whole = synthetic(twin, [1.0] * 3)
    nan = recorded(twin, whole.sensor("cables"), np.full((2, 30, 3, 6), np.nan))
    with pytest.raises(RecordingError, match="true states"):
        fitted_gains(nan)
    episode = whole.episodes[0]
    columns = {
        name: values
        for name, values in episode.columns.items()
        if name != "sensor.states"
    }
    with pytest.raises(
        RecordingError, match="this recording lacks 'states'; it has cables"
    ):
        fitted_gains(
            replace(whole, options={}, episodes=(replace(episode, columns=columns),))
        )


def test_gains_are_fitted_without_the_rows_that_were_not_measured(twin):
    whole = synthetic(twin, [0.8, 0.9, 1.1])
    states = whole.sensor("states")
    states[0, 3] = np.nan
    states[1, 5, 0, 3:] = np.nan  # axis alone
    gains = fitted_gains(recorded(twin, whole.sensor("cables"), states))
    np.testing.assert_allclose(gains, [0.8, 0.9, 1.1], rtol=1e-3)


def test_gains_cannot_be_fitted_to_a_module_that_stood_still(twin):
    still = synthetic(twin, [1.0] * 3)
    cables = still.sensor("cables")
    cables[:, :, 1] = 0.0
    with pytest.raises(RecordingError, match="did not move"):
        fitted_gains(recorded(twin, cables, still.sensor("states")))
