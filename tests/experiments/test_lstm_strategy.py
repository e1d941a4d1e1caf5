"""The LSTM strategy: training, limits, and compilation."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.evaluation import position_errors, rollout
from s2c2a.planning import Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import (
    TrainedNetworks,
    labeled,
    load_networks,
    recipe_named,
    save_networks,
)
from s2c2a.tasks import Task
from s2c2a.training import FitOptions, Trained
from s2c2a_experiments.lstm import LSTMComparison, LSTMStrategy
from s2c2a_experiments.tip_lstm import LSTMOptions, TipHistory, lstm_samples

TARGET = Goal.of(3).with_position([0.15, 0.05, 0.55])
FROZEN = FitOptions(learning_rate=0.0, max_epochs=2, epochs_per_call=2)


def train(recording, options, seed) -> TrainedNetworks:
    return LSTMComparison(options).train(recording, recipe_named("paper"), seed)


def at_work(trained) -> LSTMStrategy:
    return LSTMStrategy(trained.arm, trained.networks["LSTM"])


@pytest.fixture(scope="module")
def recording(recording):
    """Its first episode is shorter than the others, and padded."""
    first, *others = recording.episodes
    columns = {name: values[:60] for name, values in first.columns.items()}
    return replace(recording, episodes=(replace(first, columns=columns), *others))


@pytest.fixture(scope="module")
def options() -> LSTMOptions:
    return LSTMOptions(
        1, 8, FitOptions(learning_rate=1e-2, max_epochs=12, epochs_per_call=6), 0.05
    )


@pytest.fixture(scope="module")
def trained(recording, options) -> TrainedNetworks:
    """Really trained, on the small recording of the twin, a little."""
    return train(recording, options, seed=7)


@pytest.fixture(scope="module")
def strategy(trained) -> LSTMStrategy:
    return at_work(trained)


def untrained(arm, loudness: float = 1.0) -> TrainedNetworks:
    """A random LSTM of an arm; a loud one asks for full bends at once."""
    network = LSTMOptions(1, 8).untrained(arm, jax.random.key(0))
    network = eqx.tree_at(
        lambda n: n.network.weight_head, network, loudness * network.network.weight_head
    )
    return TrainedNetworks(arm, recipe_named("paper"), 0, {"LSTM": Trained(network)})


def live(strategy, arm, goals) -> tuple[np.ndarray, np.ndarray]:
    """Actions of a live session and the tips before them."""
    robot = SimulatedRobot(arm)
    strategy.start(robot.open())
    actions, tips = [], []
    for goal in goals:
        reading = robot.read()
        tips.append(reading["states"][-1, :3])
        actions.append(robot.step(strategy.step(reading, goal)))
    return np.array(actions), np.array(tips)


def bends_of(arm, actions) -> np.ndarray:
    """Bends [deg] that actions stand for: the full bend times the share of it."""
    geometry = ArmGeometry.of(arm)
    shares = geometry.commanded_bends(actions) / geometry.action_bends[:, None]
    return np.rad2deg(shares * geometry.bend_limits[:, None])


def test_training_lowers_both_losses(trained):
    curve = trained.trained["LSTM"].curve
    np.testing.assert_array_equal(curve[:, 0], np.arange(1, 13))
    assert np.all(np.diff(curve[::3, 1]) < 0)
    assert curve[-1, 2] < 0.5 * curve[0, 2]


def answers(trained, samples) -> np.ndarray:
    """Actions [m or N] of the network, without noise on its history."""
    layer = trained.networks["LSTM"].sum_and_range
    history = TipHistory(
        samples.inputs["positions"], layer.normalized(samples.inputs["actions"])
    )
    return np.asarray(
        layer.actions(trained.networks["LSTM"](samples.inputs["desired"], history))
    )


@pytest.fixture(scope="module")
def split(recording):
    return lstm_samples(
        recording.sensor("states")[:, :, -1, :3],
        recording.actions,
        np.zeros((3, 3)),
        recording.lengths,
    )


def test_the_percent_is_that_of_its_actions_in_their_units_without_padding(
    trained, split
):
    """Mean and deviation of the errors of its actions, in percent of their range."""
    targets = np.concatenate(
        [part.targets for part in (split.training, split.validation, split.test)]
    )
    percent = (
        100
        * np.abs(answers(trained, split.test) - split.test.targets)
        / np.ptp(targets, axis=0)
    )
    known = trained.trained["LSTM"].percent
    assert known == pytest.approx((percent.mean(), percent.std()), rel=1e-3)
    assert 0.5 < percent.mean() < 25


@pytest.mark.slow
def test_noise_on_the_past_actions_is_used_in_training_and_nowhere_else(
    recording, options, split
):
    """With fixed weights, noise changes the training loss alone."""
    noisy = train(recording, replace(options, fit=FROZEN, history_noise=30.0), seed=0)
    unit = np.asarray(noisy.networks["LSTM"].sum_and_range.unit)
    calm = [
        np.mean(((answers(noisy, samples) - samples.targets) / unit) ** 2)
        for samples in (split.training, split.validation)
    ]
    assert np.all(np.abs(noisy.trained["LSTM"].curve[:, 1] - calm[0]) > 0.05 * calm[0])
    np.testing.assert_allclose(noisy.trained["LSTM"].curve[:, 2], calm[1], rtol=1e-4)


def test_training_without_true_states_is_refused(recording, options):
    episode = recording.episodes[0]
    columns = dict(episode.columns)
    states = columns.pop("sensor.states")
    unknown = {**columns, "sensor.states": np.full_like(states, np.nan)}
    for kept, message in (
        (columns, "lacks 'states'"),
        (unknown, "lacks true states"),
    ):
        episodes = (replace(episode, columns=kept),)
        with pytest.raises(RecordingError, match=message):
            train(replace(recording, options={}, episodes=episodes), options, seed=0)


@pytest.fixture(scope="module")
def saved(trained, options, tmp_path_factory):
    path = tmp_path_factory.mktemp("lstm") / "deep" / "twin.safetensors"
    save_networks(labeled(trained, LSTMComparison(options)), path)
    return path


def test_everything_comes_back_from_a_file(saved, trained):
    loaded = load_networks(saved)
    assert loaded.strategy == "lstm"
    for name in ("arm", "recipe", "seed"):
        assert getattr(loaded, name) == getattr(trained, name)
    before, after = (one.trained["LSTM"] for one in (trained, loaded))
    assert after.percent == before.percent
    np.testing.assert_array_equal(after.curve, before.curve)
    for one, two in zip(
        jax.tree.leaves(before.network), jax.tree.leaves(after.network), strict=True
    ):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"layers": 1, "hidden": 8, "heads": 2}, "heads"),
        ({"layers": 0, "hidden": 8}, "damaged"),
    ],
)
def test_a_file_with_options_that_cannot_be_is_refused(saved, forged, stated, message):
    options = {"strategy_options": {"options": stated}}
    changed = forged(saved, lambda known, found: known.update(options))
    with pytest.raises(StrategyError, match=message):
        load_networks(changed)


@pytest.mark.slow
@pytest.mark.parametrize("arm_name", ["twin", "simulated"])
def test_what_it_remembers_at_work_is_what_the_windows_of_training_hold(
    arm_name, request
):
    """A live session as a recording: predictions for its windows equal the actions sent."""
    arm = request.getfixturevalue(arm_name).model_copy(update={"step_limit_deg": 90.0})
    quick = untrained(arm)
    targets = np.cumsum(
        np.random.default_rng(0).normal(0, 0.02, (60, 3)), axis=0
    ) + np.array([0.0, 0.0, 0.5])
    actions, tips = live(
        at_work(quick), arm, [Goal.of(3).with_position(target) for target in targets]
    )
    samples = lstm_samples(
        tips[None], actions[None], ArmGeometry.of(arm).action_neutral
    ).training
    samples.inputs["desired"] = targets[: len(samples.targets)].astype(np.float32)
    span = np.ptp(actions, axis=0).max()
    assert span > 1e-3 * ArmGeometry.of(arm).action_high.max()
    np.testing.assert_allclose(
        answers(quick, samples), actions[: len(samples.targets)], atol=1e-3 * span
    )


@pytest.mark.parametrize("arm_name", ["twin", "simulated"])
def test_its_bends_change_as_fast_as_the_arms_limit_and_no_faster(arm_name, request):
    arm = request.getfixturevalue(arm_name)
    geometry = ArmGeometry.of(arm)
    actions, _ = live(at_work(untrained(arm, loudness=100.0)), arm, [TARGET] * 30)
    bends = bends_of(arm, np.concatenate([geometry.action_neutral[None], actions]))
    changes = np.linalg.norm(np.diff(bends, axis=0), axis=-1)
    assert changes.max() == pytest.approx(arm.step_limit_deg, rel=1e-3)
    np.testing.assert_allclose(changes[:3], arm.step_limit_deg, rtol=1e-3)
    assert np.linalg.norm(bends[-1], axis=-1).min() > 0.7 * 50.0


def test_an_arm_whose_cables_go_slack_is_led_within_its_limits_and_still_bends(
    make_arm,
):
    """Clipping a cable at zero tension does not halve the desired bend."""
    arm = make_arm(
        2,
        4,
        {"pretension": 1.0, "tension_range": 9.0},
        actuation="tension",
        sensing="true",
    )
    strategy = at_work(untrained(arm, loudness=100.0))
    reading = Reading(0.0, {"states": np.tile([0.0, 0, 0.4, 0, 0, 1], (2, 1))})
    strategy.start(reading)
    goal = Goal.of(2).with_position([0.1, 0.1, 0.35])
    actions = np.array([strategy.step(reading, goal) for _ in range(30)])
    assert actions.min() == pytest.approx(0.0, abs=1e-5)
    assert actions.max() <= 10.0 + 1e-5
    assert actions[-1].max() > 6.0


def test_it_hears_the_desired_tip_and_nothing_else_of_a_goal(strategy, twin):
    reading = SimulatedRobot(twin).open()
    more = (
        TARGET.with_axis([1, 0, 1])
        .with_obstacles([[0.1, 0.0, 0.5]], [0.1])
        .with_position([0, 0, 0.1], module=0)
    )
    other = Goal.of(3).with_position([-0.2, 0.0, 0.5])
    answers = []
    for goal in (TARGET, more, other):
        strategy.start(reading)
        answers.append(strategy.step(reading, goal))
    np.testing.assert_array_equal(answers[0], answers[1])
    assert np.abs(answers[0] - answers[2]).max() > 1e-5


def without_tip(reading: Reading) -> Reading:
    states = reading["states"].copy()
    states[-1, 1] = np.nan
    return Reading(reading.time, {"states": states})


@pytest.mark.parametrize(
    "blind",
    [lambda reading: Reading(reading.time, {}), without_tip],
    ids=["none", "nan"],
)
def test_a_reading_without_the_true_tip_is_refused_and_changes_nothing(
    strategy, twin, blind
):
    reading = SimulatedRobot(twin).open()
    with pytest.raises(StrategyError, match="reads true states"):
        strategy.start(blind(reading))
    strategy.start(reading)
    expected = [strategy.step(reading, TARGET) for _ in range(2)]
    strategy.start(reading)
    first = strategy.step(reading, TARGET)
    with pytest.raises(StrategyError, match="reads true states"):
        strategy.step(blind(reading), TARGET)
    np.testing.assert_array_equal([first, strategy.step(reading, TARGET)], expected)


@pytest.mark.parametrize(
    "goal",
    [
        Goal.of(3),
        Goal.of(3).with_axis([0, 0, 1]),
        TARGET._replace(positions=np.full((3, 3), np.nan)),
    ],
    ids=["nothing", "axis", "nan"],
)
def test_a_goal_without_a_tip_position_is_refused(strategy, twin, goal):
    reading = SimulatedRobot(twin).open()
    strategy.start(reading)
    with pytest.raises(StrategyError, match="follows tip positions"):
        strategy.step(reading, goal)


def test_one_that_was_not_started_says_so(trained, twin):
    fresh, reading = at_work(trained), SimulatedRobot(twin).open()
    with pytest.raises(StrategyError, match="not started"):
        fresh.step(reading, TARGET)
    with pytest.raises(StrategyError, match="not started"):
        fresh.diagnostics()


def test_a_run_of_it_can_be_scored_and_even_a_little_training_leads_the_tip_towards_a_target(
    strategy, twin
):
    task = Task("hold", (TARGET,) * 40)
    done = rollout(SimulatedRobot(twin), strategy, task)
    errors = position_errors(done.after("states"), task.desired_positions())
    assert (done.options["strategy"], done.ran("sensed").shape) == ("lstm", (40, 3, 3))
    assert done.get("planned") is None
    assert errors[-10:].mean() < 0.8 * errors[0]
