"""The chain with a local model beside it, on arms that bend otherwise than the chain can say."""

from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.data.windows import stretches
from s2c2a.estimation import Estimate
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    states_from_bends,
)
from s2c2a.models import LocalOptions, local, residual_process
from s2c2a.models.chain_training import hysteresis_inputs
from s2c2a.models.local_training import _judge
from s2c2a.planning import BEST, Goal, Planner
from s2c2a.planning.terms import Extrapolation
from s2c2a.training import FitOptions, TrainingData

SIZE = LocalOptions(
    hidden=4,
    depth=1,
    play_widths=(0.02, 0.05, 0.1),
    creep_times=(2.0,),
    points=150,
    few=40,
)
FIT = FitOptions(max_epochs=3, epochs_per_call=3)
predict = eqx.filter_jit(lambda model, *inputs: model.predict(*inputs))
predictive_std = eqx.filter_jit(lambda model, *inputs: model.predictive_std(*inputs))


def data_of(arm, observed=slice(None), seed=0) -> TrainingData:
    """Random bends, and an arm that bends by a nonlinear share of them."""
    random = np.random.default_rng(seed)
    bends = np.cumsum(random.normal(0, 0.06, (4, 150, arm.module_count, 2)), axis=1)
    bends = 0.5 * np.sin(bends)
    true = bends * (0.8 + 0.3 * np.cos(4 * bends[..., ::-1]))
    lengths = np.array([module.length for module in arm.modules], np.float32)
    states = np.asarray(
        jax.jit(states_from_bends)(jnp.asarray(true, jnp.float32), lengths)
    )
    known = np.full_like(states, np.nan)
    known[..., observed] = states[..., observed]
    sensed = np.asarray(configurations_from_bends(jnp.asarray(bends, jnp.float32)))
    return TrainingData(
        arm, sensed, np.zeros((*sensed.shape[:-1], arm.cable_count)), known
    )


@pytest.fixture(scope="module", autouse=True)
def few_likelihood_samples():
    """Find the length scales in fewer steps."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(residual_process, "SUBSETS", 2)
        patched.setattr(residual_process, "STEPS", 20)
        yield


@pytest.fixture(scope="module")
def arm(make_arm):
    return make_arm(2)


@pytest.fixture(scope="module")
def trained(arm):
    return SIZE.train(data_of(arm), FIT, jax.random.key(0)).network


def test_it_is_nearer_to_the_truth_than_the_chain_alone(arm, trained):
    data = data_of(arm, seed=1)
    errors = [
        np.linalg.norm(
            (SIZE.predictions(model, data) - data.states)[..., :3], axis=-1
        ).mean()
        for model in (trained, trained.chain)
    ]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.slow
def test_samples_that_judge_train_the_model_that_is_kept_too(arm, trained):
    data = data_of(arm)
    moved = np.array(data.states)
    for episode, span in stretches([150] * 4)[2]:
        moved[episode, span, :, :3] += 0.05
    shares = []
    result = SIZE.train(
        replace(data, states=moved),
        FIT,
        jax.random.key(0),
        lambda epoch, epochs, loss: shares.append(epoch / epochs),
    )
    assert shares == [0.0, 0.5, 0.5, 1.0]
    before, after = trained.chain.equilibrium, result.network.chain.equilibrium
    assert abs(after.tautness - before.tautness).max() > 1e-4
    # which samples without payload hardly determine
    np.testing.assert_array_equal(after.log_stiffness, before.log_stiffness)


@pytest.mark.slow
def test_noise_is_not_learned_and_a_pattern_is(arm):
    data = data_of(arm)
    noise = np.random.default_rng(0).normal(0.0, 0.02, data.states.shape)
    bends = bends_from_configurations(jnp.asarray(data.sensed))
    lengths = np.array([module.length for module in arm.modules], np.float32)
    straight = np.asarray(jax.jit(states_from_bends)(bends, lengths))
    options = replace(SIZE, hidden=64, depth=2)
    fit = FitOptions(learning_rate=0.01, max_epochs=40, patience=40)
    for true, seen in ((straight, straight + noise), (data.states, data.states)):
        given = replace(data, states=seen.astype(np.float32))
        model = options.train(given, fit, jax.random.key(0)).network
        errors = (options.predictions(model, data) - true)[..., -1, :3]
        # the noise is 32 mm, and the pattern moves the tip by 13 mm
        assert np.linalg.norm(errors, axis=-1).mean() < 0.004


def test_answers_along_an_episode_are_those_of_observing_and_predicting(arm, trained):
    data = data_of(arm, seed=1)
    along, memory = SIZE.predictions(trained, data)[0], trained.start(data.sensed[0, 0])
    observe = eqx.filter_jit(lambda m, c, k: m.observe(c, k))
    chained = SIZE.predictions(trained.chain, data)[0]
    seen = hysteresis_inputs(trained.chain, data)[0]
    inputs = eqx.filter_jit(
        lambda m, c, k: m.chain.inputs(m.chain.body.displacements(c), k)
    )
    for step in range(20):
        now = data.sensed[0, step]
        np.testing.assert_allclose(inputs(trained, now, memory), seen[step], atol=1e-6)
        np.testing.assert_allclose(
            predict(trained.chain, now, memory), chained[step], atol=2e-5
        )
        # weights of the process are up to 30: single precision leaves hundredths of a
        # millimeter of their sum
        np.testing.assert_allclose(
            predict(trained, now, memory), along[step], atol=1e-4
        )
        memory = observe(trained, now, memory)


@pytest.mark.slow
def test_near_a_configuration_it_says_the_same_and_has_the_same_slopes(arm, trained):
    sensed = jnp.asarray(data_of(arm, seed=2).sensed[0])
    memory, here = trained.start(sensed[40]), bends_from_configurations(sensed[41])
    near = eqx.filter_jit(lambda m: m.near(sensed[41], memory))(trained)
    # delays are left out, all else is looked at anew
    there = replace(trained, chain=near.chain)
    look = eqx.filter_jit(
        lambda m, bends: m.predict(configurations_from_bends(bends), memory)
    )
    np.testing.assert_allclose(look(near, here), look(there, here), atol=2e-5)
    np.testing.assert_allclose(
        look(near, here + 0.01), look(there, here + 0.01), atol=3e-4
    )
    engaged = near.for_planning()
    np.testing.assert_allclose(
        look(engaged, here + 0.1), look(near, here + 0.1), atol=2e-5
    )


def test_at_a_high_rate_plans_are_judged_by_where_the_arm_arrives(arm):
    """A tenth of a second stands between motors and arm: in one step hardly anything moves."""
    quick = arm.model_copy(update={"control_rate": 100.0})
    model = SIZE.untrained(quick, jax.random.key(0))
    hysteresis = model.chain.hysteresis
    assert hysteresis.delays == 1
    late = eqx.tree_at(
        lambda m: (m.chain.hysteresis.play_weights, m.chain.hysteresis.delay_weights),
        model,
        (
            jnp.full_like(hysteresis.play_weights, -20.0),
            hysteresis.delay_weights.at[:, 0].set(1.0),
        ),
    )
    sensed = jnp.asarray(data_of(arm, seed=2).sensed[0])
    memory = late.start(sensed[0])
    there = configurations_from_bends(bends_from_configurations(sensed[0]) + 0.1)
    before = predict(late, sensed[0], memory)
    rest = predict(late, there, late.start(there))
    moved = predict(late, there, memory) - before
    assert np.abs(moved).max() < 0.15 * np.abs(rest - before).max()
    near = eqx.filter_jit(lambda m: m.near(sensed[0], memory))(late)
    np.testing.assert_allclose(predict(near, there, memory), rest, atol=1e-5)


def test_errors_on_data_held_out_are_about_those_that_it_expects(arm, trained):
    """They are smaller, for the deviation counts slower motion and larger bends, too."""
    data = data_of(arm, seed=3)
    straight = trained.start(data.sensed[0, 0])
    expected = np.asarray(
        predictive_std(
            trained,
            jnp.asarray(data.sensed[0, :40]),
            jax.tree.map(
                lambda part: jnp.broadcast_to(part, (40, *part.shape)), straight
            ),
        )
    )
    errors = np.linalg.norm(
        (SIZE.predictions(trained, data) - data.states)[0, :40, :, :3], axis=-1
    )
    assert (
        0.1
        < np.sqrt((errors[:, -1] ** 2).mean()) / np.sqrt((expected[:, -1] ** 2).mean())
        < 5.0
    )


@pytest.mark.slow
def test_a_plan_stops_short_of_what_the_data_do_not_show_and_says_so(
    arm, trained, monkeypatch
):
    """Half a radian about each axis was seen; the target asks for more than the limit."""
    monkeypatch.setattr(local, "PRIOR_STD", 1.0)  # to decide beside the position
    goal = Goal.of(2).with_position([0.27, 0.0, 0.15])
    terms = tuple(term for term in BEST.terms if not isinstance(term, Extrapolation))
    ends = []
    for options in (BEST, replace(BEST, terms=terms)):
        planner = Planner(arm, trained, options)
        plan = planner.start(Estimate(np.tile([0.0, 0.0, 1.0], (2, 1))))
        for _ in range(40):
            plan = planner.plan(plan, Estimate(plan.configurations), goal)
        ends.append(
            (
                float(plan.expectation.extrapolation),
                float(np.min(plan.configurations[:, 2])),
            )
        )
    # the cautious plan trades the distance to the goal for the expected error
    (careful, highest), (doubt, lowest) = ends
    assert careful < 0.65 * doubt
    assert doubt > 0.01
    assert highest > lowest + 0.05


def test_of_the_tip_alone_it_learns_the_tip_and_leaves_the_rest_to_the_chain(arm):
    data, tip = data_of(arm), data_of(arm)
    tip.states[..., :-1, :] = np.nan
    tip.states[..., 3:] = np.nan
    model = SIZE.train(tip, FIT, jax.random.key(0)).network
    said = SIZE.predictions(model, data)
    assert np.isfinite(said).all()
    assert np.linalg.norm((said - data.states)[..., -1, :3], axis=-1).mean() < 0.02
    np.testing.assert_allclose(
        said[..., 0, :], SIZE.predictions(model.chain, data)[..., 0, :], atol=1e-5
    )


def test_where_cables_move_together_that_counts_too(arm):
    data = data_of(arm)
    together = np.sin(np.arange(150) / 20.0)[None, :, None, None] * np.ones(
        (4, 1, 2, 3)
    )
    moved = 0.3 * together + np.asarray(
        SIZE.untrained(arm, jax.random.key(0)).chain.body.displacements(data.sensed)
    )
    data.states[..., 2] += 0.05 * together[..., 0]
    model = SIZE.train(
        replace(data, displacements=moved), FIT, jax.random.key(0)
    ).network
    moving = replace(data, displacements=moved)
    said = SIZE.predictions(model, moving)
    assert np.abs(said - data.states)[..., 2].mean() < 0.01
    # cables apart from the data are less known
    far = replace(data, displacements=moved + 1.0)
    near, away = (SIZE.deviations(model, each) for each in (moving, far))
    assert (away > near).all()


@pytest.mark.slow
def test_away_from_the_data_the_chain_predicts_with_the_mean_residual(arm, trained):
    inputs = jnp.asarray(hysteresis_inputs(trained.chain, data_of(arm, seed=2))[0, -1])
    look = eqx.filter_jit(lambda model, inputs: model.states(inputs))
    far = 50.0 * inputs
    constant = np.asarray(trained.process.constant).reshape(-1, 6)
    np.testing.assert_allclose(
        look(trained, far)[:, :3],
        look(trained.chain, far)[:, :3] + trained.unit * constant[:, :3],
        atol=1e-4,
    )


def test_what_the_chain_leaves_without_pattern_is_left_to_it(arm):
    data = data_of(arm)
    noise = np.random.default_rng(0).normal(0, 0.2, data.states.shape)
    trained = SIZE.train(
        replace(data, states=data.states + noise), FIT, jax.random.key(0)
    )
    process = trained.network.process
    assert not process.is_fitted
    assert float(process.scale.min()) > 0.0
    assert trained.errors["held-out samples"] > 0.2


@dataclass(frozen=True)
class StatedProcess:
    """A process that predicts nothing, with deviations that its samples state."""

    scale: np.ndarray

    def given(self, features, residual):
        return self

    def __call__(self, features):
        return 0.0

    def deviations(self, features):
        return np.asarray(features)[:, 0]


def test_samples_whose_ends_are_not_seen_judge_no_noise():
    random = np.random.default_rng(0)
    seen = [(np.full((30, 1), 0.5), random.normal(size=(30, 6))) for _ in range(3)]
    unseen = np.full((300, 1), 4.0), np.full((300, 6), np.nan)
    with_gaps = [
        tuple(map(np.concatenate, zip(part, unseen, strict=True))) for part in seen
    ]
    process = StatedProcess(np.ones(6))
    one, other = (_judge(process, parts, 1.0) for parts in (seen, with_gaps))
    np.testing.assert_allclose(other.process.scale, one.process.scale, rtol=1e-6)
    assert other.surprise == pytest.approx(one.surprise)
