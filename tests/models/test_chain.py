"""The chain model: predictions before training, hysteresis, supported arms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    configurations_from_states,
    states_from_bends,
)
from s2c2a.models import ChainOptions
from s2c2a.models.chain import ChainC2S
from s2c2a.training.fit import held

SMALL = ChainOptions(hidden=8, depth=1, play_widths=(0.02, 0.1), creep_times=(2.0,))
start = eqx.filter_jit(lambda model, sensed: model.start(sensed))
observe = eqx.filter_jit(lambda model, sensed, memory: model.observe(sensed, memory))
predict = eqx.filter_jit(
    lambda model, configurations, memory: model.predict(configurations, memory)
)


def untrained(arm: ArmSpec, size=SMALL, seed=0) -> ChainC2S:
    return size.untrained(arm, jax.random.key(seed))


def shaken(model: ChainC2S, seed=0) -> ChainC2S:
    """Change every learned weight a little, so that all parts of the model count."""
    random = np.random.default_rng(seed)

    def move(leaf):
        return leaf + jnp.asarray(random.normal(0, 0.2, leaf.shape), dtype=leaf.dtype)

    def parts(m):
        return [
            m.hysteresis.play_weights,
            m.hysteresis.creep.total,
            m.hysteresis.creep.spectrum,
            m.equilibrium.log_stiffness,
            m.equilibrium.tautness,
            m.equilibrium.coupling,
            m.equilibrium.relaxation.total,
            m.equilibrium.relaxation.spectrum,
            m.mixing,
            m.network.layers[-1].weight,
            m.network.layers[-1].bias,
        ]

    return eqx.tree_at(parts, model, [move(leaf) for leaf in parts(model)])


def way(seed, steps, modules, reach=0.25):
    """Configurations of bends that wander, shape (steps, modules, 3)."""
    bends = np.cumsum(
        np.random.default_rng(seed).normal(0, reach / 4, (steps, modules, 2)), axis=0
    )
    return np.asarray(configurations_from_bends(jnp.asarray(bends, dtype=jnp.float32)))


def of_kind(make_arm, kind, modules=3, cables=3) -> ArmSpec:
    """An arm whose readings are encoders', true, coupled, or that is driven by tension."""
    tension = {"pretension": 20.0, "tension_range": 20.0}
    coupling = tuple(
        tuple(1.0 / (row + 1) * (column <= row) for column in range(modules))
        for row in range(modules)
    )
    kinds = {
        "encoders": {},
        "true": {"sensing": "true"},
        "coupled": {"sensing_coupling": coupling},
        "tension": {"actuation": "tension", "module": tension},
    }
    return make_arm(modules, cables, **kinds[kind])


@pytest.fixture(params=["encoders", "true"])
def model(make_arm, request):
    """A chain with or without statics, all parts of which count."""
    return shaken(untrained(of_kind(make_arm, request.param)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["true", "coupled", "tension"])
def test_untrained_without_statics_it_says_arcs_of_the_sensed_bends(make_arm, kind):
    model, configurations = untrained(of_kind(make_arm, kind)), way(1, 1, 3)[0]
    states = predict(model, configurations, start(model, configurations))
    arcs = states_from_bends(
        bends_from_configurations(jnp.asarray(configurations)), jnp.full(3, 0.2)
    )
    assert not model.statics
    np.testing.assert_allclose(states, arcs, atol=0.02)


def test_untrained_a_straight_arm_of_pulling_cables_is_straight(make_arm):
    model = untrained(make_arm())
    straight = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1))
    states = predict(model, straight, start(model, straight))
    assert model.statics
    np.testing.assert_allclose(
        states[:, :3], [[0, 0, 0.2], [0, 0, 0.4], [0, 0, 0.6]], atol=5e-3
    )


@pytest.mark.parametrize("azimuth", [0.0, 0.7, 2.5, -1.8])
def test_untrained_pulling_cables_bend_the_arm_where_they_want_it_but_less_far(
    make_arm, azimuth
):
    bend = 0.5 * np.array([np.cos(azimuth), np.sin(azimuth)])
    configurations = np.asarray(
        configurations_from_bends(
            jnp.tile(jnp.asarray(bend, dtype=jnp.float32), (3, 1))
        )
    )
    # none shorter
    model = eqx.tree_at(
        lambda m: m.equilibrium.log_axial_compliance,
        untrained(make_arm()),
        jnp.full(3, -1.0),
    )
    found = bends_from_configurations(
        configurations_from_states(
            predict(model, configurations, start(model, configurations))
        )
    )
    shares = np.asarray(found) @ bend / 0.25
    assert ((shares > 0.5) & (shares < 1.0)).all()


def test_for_planning_it_predicts_the_same(model):
    planning, configurations = model.for_planning(), way(2, 8, 3)
    memory = start(model, configurations[0])
    for one in configurations[1:]:
        expected, found = predict(model, one, memory), predict(planning, one, memory)
        np.testing.assert_allclose(found, expected, atol=1e-5)
        memory = observe(model, one, memory)


def test_what_was_sensed_before_is_remembered(model):
    """The same configuration reached from two sides."""
    here = way(3, 1, 3)[0]
    sides = [
        configurations_from_bends(bends_from_configurations(jnp.asarray(here)) + shift)
        for shift in (-0.3, 0.3)
    ]
    one, other = (
        predict(model, here, observe(model, here, start(model, side))) for side in sides
    )
    assert np.abs(one - other).max() > 1e-3


def test_a_batch_is_its_members_one_by_one(model):
    first, then = way(6, 8, 3).reshape(2, 4, 3, 3), way(7, 8, 3).reshape(2, 4, 3, 3)
    together = predict(model, then, start(model, first))
    assert together.shape == (2, 4, 3, 6)
    np.testing.assert_allclose(
        together[1, 2], predict(model, then[1, 2], start(model, first[1, 2])), atol=1e-5
    )


def test_slopes_exist_at_rest_straight_and_bent(model):
    planning = model.for_planning()
    straight = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1))
    slopes = eqx.filter_jit(
        jax.jacrev(lambda c: planning.predict(c, planning.start(straight)))
    )
    for configurations in (straight, jnp.asarray(way(8, 1, 3)[0])):
        assert np.isfinite(slopes(configurations)).all()


def test_training_cannot_move_what_follows_from_the_arm(make_arm):
    model, configurations = shaken(untrained(make_arm())), jnp.asarray(way(9, 1, 3)[0])
    inputs = model.inputs(
        model.body.displacements(configurations), model.start(configurations)
    )
    gradient = eqx.filter_jit(
        eqx.filter_grad(lambda m: jnp.sum(held(m).states(inputs) ** 2))
    )(model)
    fixed = jax.tree.leaves((gradient.body, gradient.hysteresis.operators))
    assert all(not np.any(leaf) for leaf in fixed)
    learned = (
        gradient.hysteresis.play_weights,
        gradient.equilibrium.log_stiffness,
        gradient.equilibrium.tautness,
        gradient.network,
    )
    assert all(np.any(leaf) for leaf in jax.tree.leaves(learned))


def test_the_twin_and_the_simulated_arm_are_told_apart():
    assert untrained(load_arm("twin_arm")).statics
    assert not untrained(load_arm("simulated_arm")).statics
    assert not untrained(
        load_arm("twin_arm"), ChainOptions(hidden=8, depth=1, statics=False)
    ).statics


def test_a_body_that_relaxes_stays_bent_towards_where_it_was_held(twin):
    model = untrained(twin)
    total = jnp.full(model.equilibrium.relaxation.total.shape, 3.0)
    model = eqx.tree_at(lambda m: m.equilibrium.relaxation.total, model, total)
    model = eqx.tree_at(lambda m: m.body.gravity, model, jnp.zeros(3))
    straight = configurations_from_bends(jnp.zeros((3, 2)))
    bent = configurations_from_bends(jnp.tile(jnp.array([0.4, 0.0]), (3, 1)))
    held_there, memory = model.start(straight), model.start(straight)
    for _ in range(100):  # five of the filter's times
        held_there = observe(model, bent, held_there)
    left = predict(model, straight, held_there) - predict(model, straight, memory)
    assert 0.001 < left[-1, 0] < 0.1
    for _ in range(200):
        held_there = observe(model, straight, held_there)
    np.testing.assert_allclose(
        predict(model, straight, held_there),
        predict(model, straight, memory),
        atol=1e-3,
    )
