"""The paper in one file computes what the recipe `paper` does, with the same weights."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from by_hand import numbers
from s2c2a import paper
from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.data import CollectOptions, collect, controller_samples, forward_samples
from s2c2a.errors import TrainingError
from s2c2a.estimation import Estimate, configuration_map_for
from s2c2a.models import C2A, C2S
from s2c2a.models import actions as recipe_actions
from s2c2a.models import c2s as recipe_c2s
from s2c2a.models.layers import Scaling, SumAndRange
from s2c2a.planning import PAPER, Goal, Planner
from s2c2a.planning.planner import Step
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import RECIPES, TrainedNetworks, s2c2a_strategy
from s2c2a.tasks import circle
from s2c2a.training import FitOptions, Trained
from s2c2a.training.trained import as_batch

from marks import slow_after

TWIN = load_arm("twin_arm")
NEUTRAL = ArmGeometry.of(TWIN).action_neutral
close = partial(np.testing.assert_allclose, rtol=1e-5, atol=1e-5)


def affine(kind, seed, features):
    """A scaling of random center and range."""
    half_range = np.abs(numbers(seed + 1, features)) + 0.5
    return kind(jnp.asarray(numbers(seed, features)), jnp.asarray(half_range))


def networks(scaling=paper.Scaling):
    """Tiny networks of the paper and of the recipe, with the same weights."""
    keys = jax.random.split(jax.random.key(0))
    c2s_network = paper.BiLSTM(3, 6, layers=2, hidden=8, key=keys[0])
    c2a_network = paper.BiLSTM(31, 3, layers=1, hidden=8, key=keys[1])
    c2s = c2s_network, affine(scaling, 1, 3), affine(scaling, 2, 6)
    c2a = c2a_network, affine(scaling, 3, 3)
    if scaling is paper.Scaling:
        return paper.C2S(*c2s), paper.C2A(*c2a)
    return C2S(*c2s), C2A(*c2a, SumAndRange.of(TWIN))


C2S_PAPER, C2A_PAPER = networks()
C2S_RECIPE, C2A_RECIPE = networks(Scaling)


def configurations(seed, *batch):
    """Unit vectors bent by up to half a radian, shape (*batch, 3, 3)."""
    vectors = numbers(seed, *batch, 3, 3) * 0.2 + np.array([0, 0, 1], np.float32)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def displacements(seed, *batch):
    """Cable displacements with a common part, as measured [m]."""
    return 0.005 * numbers(seed, *batch, 3, 3)


def everything_asked(seed):
    """A goal with each kind of target and an obstacle around the tip."""
    goal = Goal.of(3, change_weight=0.3).with_position(numbers(seed, 3))
    goal = goal.with_position([0.1, 0.0, 0.2], weight=2.0, module=0)
    goal = goal.with_axis(numbers(seed + 1, 3))
    tip = np.asarray(C2S_PAPER(configurations(seed + 2)))[-1, :3]
    return goal.with_obstacles([tip + 0.02, tip - 0.05, tip + 9.0], [0.2, 0.4, 0.1])


@pytest.fixture(scope="module")
def recording():
    """Random data of two episodes, as from a robot."""
    states = numbers(5, 2, 100, 3, 6)
    actions = displacements(6, 2, 100).astype(float)
    return paper.Recording(configurations(4, 2, 100), states, actions)


def test_configurations_from_encoders_are_those_of_the_recipe():
    measured = np.concatenate([displacements(0, 50), np.zeros((1, 3, 3), np.float32)])
    reading = Reading(0.0, {"cables": measured})
    expected = configuration_map_for(TWIN).configurations(reading)
    close(paper.configurations_from_encoders(TWIN, jnp.asarray(measured)), expected)


def test_a_recording_is_that_of_the_recipe(tmp_path):
    recorded = paper.collect(TWIN, 2, 12, seed=3)
    options = CollectOptions("staged", 2, 12, seed=3)
    other = collect(
        tmp_path / "a.episodes", TWIN, partial(SimulatedRobot, TWIN, "fast"), options
    )
    close(recorded.actions, other.actions)
    close(recorded.states, other.sensor("states"))
    sensed = configuration_map_for(TWIN).configurations(other.readings())
    close(recorded.configurations, sensed)


@pytest.mark.parametrize("part", paper.PARTS)
def test_samples_are_those_of_the_recipe(recording, part):
    ours = paper.c2s_samples(recording, part)
    split = forward_samples(recording.configurations, recording.states)
    theirs = getattr(split, part)
    close(ours.inputs, theirs.inputs["configurations"])
    close(ours.targets, theirs.targets)
    windows = paper.c2a_samples(TWIN, recording, part)
    split = controller_samples(recording.configurations, recording.actions, NEUTRAL)
    theirs = getattr(SumAndRange.of(TWIN).scaled(split, ages=-2), part)
    desired, history = windows.inputs
    close(desired, theirs.inputs["desired"])
    close(history.configurations, theirs.inputs["configurations"])
    close(history.actions, theirs.inputs["actions"])
    close(windows.targets, theirs.targets)


def test_networks_and_their_last_layer_are_those_of_the_recipe():
    desired = configurations(7, 4)
    close(C2S_PAPER(desired), C2S_RECIPE.predict(desired, ()))
    history = paper.History(configurations(8, 4, 4), numbers(9, 4, 3, 5, 3))
    history = history._replace(configurations=history.configurations.swapaxes(1, 2))
    close(C2A_PAPER(desired, history), C2A_RECIPE(desired, history))
    raw = 3 * numbers(10, 4, 3, 3)
    close(paper.sum_and_range(raw), SumAndRange.of(TWIN)(raw))
    unit = np.broadcast_to(paper.action_unit(TWIN), (3, 3))
    close(unit, SumAndRange.of(TWIN).actions(jnp.ones((3, 3))))


def test_training_losses_are_those_of_the_recipe(recording):
    split = forward_samples(recording.configurations, recording.states)
    ours = paper.c2s_loss(C2S_PAPER, paper.c2s_samples(recording, "training"), None)
    close(ours, recipe_c2s._loss(C2S_RECIPE, as_batch(split.training), None))
    windows = paper.c2a_samples(TWIN, recording, "training")
    split = controller_samples(recording.configurations, recording.actions, NEUTRAL)
    batch = as_batch(SumAndRange.of(TWIN).scaled(split, ages=-2).training)
    noise = RECIPES["paper"].history_noise
    loss = recipe_actions.NoisyLoss(recipe_actions.predict_actions, noise)
    for key in (None, jax.random.key(1)):
        ours = paper.c2a_loss(C2A_PAPER, windows, key)
        close(ours, loss(C2A_RECIPE, batch, key))


@pytest.mark.slow
def test_scalings_and_sizes_before_training_are_those_of_the_recipe(recording):
    recipe = RECIPES["paper"]
    network_key, _ = jax.random.split(jax.random.key(2))
    c2s = paper.train_c2s(recording, jax.random.key(2), epochs=0)
    jax.tree.map(close, c2s.network, recipe.c2s.untrained(TWIN, network_key).network)
    c2a = paper.train_c2a(TWIN, recording, jax.random.key(2), epochs=0)
    jax.tree.map(close, c2a.network, recipe.c2a.untrained(TWIN, network_key).network)
    states = forward_samples(recording.configurations, recording.states).training
    theirs = Scaling.of_states(states.targets)
    close(c2s.state_scaling.half_range, theirs.half_range)
    fit = FitOptions(paper.LEARNING_RATE, paper.BATCH_SIZE, paper.EPOCHS)
    assert fit == recipe.c2s_fit == recipe.c2a_fit


@pytest.mark.parametrize("seed", slow_after(1, [11, 12, 13]))
def test_the_cost_is_that_of_the_recipe(seed):
    last = jnp.asarray(configurations(seed))
    now = jnp.asarray(configurations(seed + 2))
    goal = everything_asked(seed)
    step = Step.of(TWIN, C2S_RECIPE, PAPER)
    problem = step.problem(step.started(last), goal)
    unit = paper.WORKSPACE_SHARE * TWIN.length
    expected = problem.sum_of_norms(now)
    np.testing.assert_allclose(
        paper.cost(now, last, C2S_PAPER, goal, unit), expected, rtol=1e-5
    )


@pytest.mark.parametrize("seed", slow_after(1, [14, 15]))
def test_the_plan_is_that_of_the_recipe(seed):
    planner = Planner(TWIN, C2S_RECIPE, PAPER)
    plan = planner.start(Estimate(configurations(seed)))
    planned = jnp.asarray(plan.configurations)
    next_plan = eqx.filter_jit(partial(paper.plan, TWIN, C2S_PAPER))
    for step in range(3):
        goal = everything_asked(seed + step)
        plan = planner.plan(plan, Estimate(configurations(seed)), goal)
        planned = next_plan(planned, goal)
        close(planned, plan.configurations)


def test_control_steps_are_those_of_the_recipe():
    trained = {"C2S": Trained(C2S_RECIPE), "C2A": Trained(C2A_RECIPE)}
    strategy = s2c2a_strategy(TrainedNetworks(TWIN, RECIPES["paper"], 0, trained))
    measured = displacements(16, 4)
    strategy.start(Reading(0.0, {"cables": measured[0]}))
    planned = paper.configurations_from_encoders(TWIN, measured[0])
    history = paper.History.at_rest(planned)
    unit = paper.action_unit(TWIN)
    step = eqx.filter_jit(partial(paper.control_step, TWIN, C2S_PAPER, C2A_PAPER))
    for number, cables in enumerate(measured):
        goal = everything_asked(17 + number)
        action, planned, history = step(planned, history, jnp.asarray(cables), goal)
        expected = strategy.step(Reading(0.1 * number, {"cables": cables}), goal)
        normalized = partial(np.testing.assert_allclose, rtol=0, atol=1e-5)
        normalized(action / unit, expected / unit)
        normalized(planned, strategy.diagnostics()["planned"])


@pytest.mark.slow
def test_training_lowers_the_loss_and_moves_no_scaling(recording):
    samples = paper.c2s_samples(recording, "training")
    key = jax.random.key(3)
    both = [samples, samples]
    trained = paper.fit(C2S_PAPER, paper.c2s_loss, both, key, epochs=4)
    before = paper.c2s_loss(C2S_PAPER, samples, None)
    assert paper.c2s_loss(trained, samples, None) < before
    close(trained.state_scaling.center, C2S_PAPER.state_scaling.center)


def test_the_file_collects_trains_and_follows_the_circle_by_itself(monkeypatch, capsys):
    monkeypatch.setattr(paper, "C2S_SIZE", {"layers": 1, "hidden": 4})
    monkeypatch.setattr(paper, "C2A_SIZE", {"layers": 1, "hidden": 4})
    paper.main(episodes=2, samples=70, epochs=1)
    assert "cm from the circle" in capsys.readouterr().out


@pytest.mark.parametrize("sizes", [(0, 70), (18, 0), (18, 1), (18, 20)])
def test_a_recording_of_too_few_samples_is_refused(sizes, monkeypatch):
    monkeypatch.setattr(paper, "C2S_SIZE", {"layers": 1, "hidden": 4})
    with pytest.raises(TrainingError, match=r"give (some|more)"):
        paper.main(*sizes, epochs=1)


def test_the_circle_is_that_of_the_task_but_for_the_approach():
    desired = circle(TWIN).desired_positions()[:, -1]
    ours = paper.circle(TWIN)
    assert len(ours) == len(desired)
    assert np.linalg.norm(ours - desired, axis=-1).max() < 0.001
