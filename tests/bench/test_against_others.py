"""PyTorch and PyElastica are given the same work as we are; without them these tests are skipped, and say so."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.bench import extras
from s2c2a.bench.extras import MissingExtraError, module_with
from s2c2a.bench.measurement import Skipped
from s2c2a.bench.plan import against_torch, room_for_obstacles
from s2c2a.bench.rods import ElasticaLayout, rods
from s2c2a.networks import C2A, C2S, History
from s2c2a.planning import Planner
from s2c2a.robots.simulation.rod_cases import rod_cases
from s2c2a.strategies.scale import planning_scale
from s2c2a.tasks import task_named

NO_TORCH = 'PyTorch is not installed; it comes with the extra "bench"'
NO_ELASTICA = 'PyElastica is not installed; it comes with the extra "bench"'


def quiet(*_):
    """A progress that tells nobody."""


@pytest.fixture
def torch():
    return pytest.importorskip("torch", reason=NO_TORCH)


@pytest.mark.parametrize("task", ["circle", "tilt-50", "hold-base"])
def test_pytorch_plans_the_same_from_the_same_start(torch, tiny_networks, task):
    others = module_with("torch", "torch_planner")
    arm = tiny_networks.arm
    ours = Planner(arm, tiny_networks.c2s, planning_scale(arm), tiny_networks.recipe.planner)
    theirs = others.planner_of(tiny_networks)
    plan = ours.start(np.tile(np.array([0.0, 0.0, 1.0], np.float32), (3, 1)))
    for goal in task_named(task, arm).goals[::8]:
        last = plan.configurations
        plan = ours.plan(plan, last, goal)
        planned = theirs.plan(others.tensor(last), others.TorchGoal.of(goal)).numpy()
        np.testing.assert_allclose(planned, np.asarray(plan.configurations), atol=1e-4)
        assert np.abs(planned - np.asarray(last)).max() > 1e-3


def test_pytorch_predicts_the_same_states(torch):
    others = module_with("torch", "torch_networks")
    model = C2S.untrained(layers=3, hidden=16, key=jax.random.key(1))
    inputs = np.random.default_rng(0).normal(size=(7, 4, 3)).astype(np.float32)
    with torch.no_grad():
        theirs = others.TorchC2S(model)(others.tensor(inputs)).numpy()
    np.testing.assert_allclose(theirs, model.predict(jnp.asarray(inputs), ()), atol=1e-5)


@pytest.mark.parametrize("cables", [3, 5])
def test_pytorch_controls_the_same(torch, make_arm, cables):
    others = module_with("torch", "torch_networks")
    model = C2A.untrained(make_arm(modules=4, cables=cables), layers=2, hidden=16, key=jax.random.key(2))
    random = np.random.default_rng(1)
    shapes = (7, 4, 3), (7, 4, 4, 3), (7, 4, 5, cables)
    wanted, sensed, actions = (random.normal(size=shape).astype(np.float32) for shape in shapes)
    with torch.no_grad():
        theirs = others.TorchC2A(model)(*(others.tensor(values) for values in (wanted, sensed, actions))).numpy()
    ours = model(jnp.asarray(wanted), History(jnp.asarray(sensed), jnp.asarray(actions)))
    np.testing.assert_allclose(theirs, ours, atol=1e-5)


def test_pytorch_learns_from_the_same_samples(torch, recording, tiny_recipe):
    others = module_with("torch", "torch_training")
    for training in others.trainings(recording, tiny_recipe, seed=0).values():
        assert training.take_best_threads(1) == 1
        training.epoch()
        first = training.best_loss
        assert all(training.epoch() > 0 for _ in range(5))
        assert training.best_loss < first


def test_the_plan_is_measured_beside_pytorch(torch, tiny_networks):
    same, ours, theirs, times = against_torch(tiny_networks, 3, quiet)
    assert same.kept
    assert theirs.median > ours.median > 0
    assert times.median == pytest.approx(theirs.median / ours.median)


def test_without_pytorch_the_plan_alone_is_measured_and_the_rest_is_said_to_be_skipped(tiny_networks, monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"\.\[bench\]"):
        module_with("torch", "torch_planner")
    ours, skipped = against_torch(tiny_networks, 3, quiet)
    assert ours.median > 0
    assert isinstance(skipped, Skipped)
    assert "torch" in skipped.why


def test_room_for_obstacles_is_weighed_against_the_least_room(tiny_networks):
    whole, small, times = room_for_obstacles(tiny_networks, 3, quiet)
    assert "room for 64" in whole.what
    assert "room for 0" in small.what
    assert times.median == pytest.approx(whole.median / small.median)


def test_pyelastica_rests_where_the_rod_does():
    pytest.importorskip("elastica", reason=NO_ELASTICA)
    room = module_with("elastica", "elastica")
    case = next(case for case in rod_cases() if case.name == "C")
    rod = room.ElasticaRod(case, 15, 2e-4, 4.0)
    for _ in range(8):
        rod.advance(0.25)
    near = rod.tip
    rod.advance(0.25)
    assert np.linalg.norm(rod.tip - near) < 1e-3
    assert np.linalg.norm(rod.tip - case.tip) < 5e-3


def test_every_engine_tells_speed_and_error(monkeypatch):
    cases = [case for case in rod_cases() if case.name == "E"]
    layouts = (ElasticaLayout(15, 2e-4, 4.0),)
    try:
        module_with("elastica", "elastica")
    except MissingExtraError:
        layouts = ()
    lines = [line for line in rods(cases, layouts, 2, quiet) if not isinstance(line, Skipped)]
    speeds = [line for line in lines if line.unit == "arm s/s"]
    assert [line.what for line in speeds][:2] == ["fast", "accurate"]
    assert all(line.median > 0 and line.error < 5e-3 for line in speeds)
    assert len(lines) == len(speeds) + 2 * len(layouts)
