"""Networks of one arm for another of the same make."""

from dataclasses import asdict, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.errors import StrategyError, TrainingError
from s2c2a.models import LocalOptions
from s2c2a.models.chain_training import hysteresis_inputs, predict_states
from s2c2a.models.transfer import (
    babbling_data,
    interpolation_weights,
    states_under_gravity,
)
from s2c2a.models.trunk import Trunk
from s2c2a.strategies import (
    load_networks,
    recipe_named,
    save_networks,
    train_s2c2a,
    training_data,
    transferred,
)
from s2c2a.strategies.s2c2a import TrainedNetworks


def of_count(arm, count: int):
    """The same arm with so many of its modules, in turn."""
    return arm.model_copy(
        update={
            "modules": tuple(
                arm.modules[one % arm.module_count] for one in range(count)
            )
        }
    )


def with_cables(arm, stiffness: float):
    """The same arm with other cables."""
    modules = [
        module.model_copy(
            update={"cable": module.cable.model_copy(update={"stiffness": stiffness})}
        )
        for module in arm.modules
    ]
    return arm.model_copy(update={"modules": tuple(modules)})


def test_begun_from_itself_says_the_same(
    tiny_best_networks, recording, tiny_best_recipe
):
    begun = transferred(tiny_best_networks, tiny_best_networks.arm)
    inputs = hysteresis_inputs(begun.c2s, training_data(recording, tiny_best_recipe))[0]
    np.testing.assert_array_equal(
        predict_states(begun.c2s, inputs),
        predict_states(tiny_best_networks.c2s, inputs),
    )


def test_what_the_description_says_is_the_new_arm_s(tiny_best_networks, twin):
    other = with_cables(twin, 6000.0)
    chain, old = transferred(tiny_best_networks, other).c2s, tiny_best_networks.c2s
    for mine, described in zip(
        jax.tree.leaves(chain.body), jax.tree.leaves(Trunk.of(other)), strict=True
    ):
        np.testing.assert_array_equal(mine, described)
    ratio = [6000.0 / module.cable.stiffness for module in twin.modules]
    np.testing.assert_allclose(
        np.exp(chain.equilibrium.log_stiffness - old.equilibrium.log_stiffness),
        ratio,
        rtol=1e-5,
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 5])
def test_other_counts_of_modules_begin_and_are_kept(
    tiny_best_networks, twin, count, tmp_path
):
    arm, recipe = of_count(twin, count), replace(tiny_best_networks.recipe, episodes=2)
    begun = transferred(replace(tiny_best_networks, recipe=recipe), arm)
    save_networks(begun, tmp_path / "begun.safetensors")
    read = load_networks(tmp_path / "begun.safetensors", arm)
    straight = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (count, 1))
    at_rest = eqx.filter_jit(lambda c2s: c2s.predict(straight, c2s.start(straight)))
    states = at_rest(read.c2s)
    assert states.shape == (count, 6)
    assert np.linalg.norm(states[-1, :2]) < 0.1 * arm.length
    np.testing.assert_allclose(states, at_rest(begun.c2s), atol=1e-6)


def test_a_module_takes_what_is_at_its_place():
    np.testing.assert_array_equal(interpolation_weights(4, 4), np.eye(4))
    places = interpolation_weights(4, 6)
    np.testing.assert_allclose(places.sum(axis=1), 1.0)
    np.testing.assert_allclose(places @ np.arange(4.0), np.linspace(0.0, 3.0, 6))
    np.testing.assert_array_equal(interpolation_weights(3, 1), [[0.0, 1.0, 0.0]])


@pytest.mark.slow
def test_weights_bend_a_standing_arm_further_and_a_hanging_one_less(
    tiny_best_recipe, twin
):
    leant = []
    for gravity in ((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        arm = twin.model_copy(update={"gravity_direction": gravity})
        chain = tiny_best_recipe.c2s.untrained(arm, jax.random.key(0))
        inputs = hysteresis_inputs(
            chain,
            babbling_data(arm, replace(tiny_best_recipe, episodes=1).collect_options()),
        )[0, 20:40]
        states = states_under_gravity(chain, jnp.asarray(inputs))
        leant.append(float(np.linalg.norm(states[:, -1, 3:5], axis=-1).mean()))
    assert leant[0] > leant[1] > leant[2]


@pytest.mark.slow
def test_a_local_model_of_another_count_knows_where_its_arm_would_be_moved(
    twin, tiny_best_recipe
):
    """With the chain of the tests above, whose programs it shares."""
    chain = asdict(tiny_best_recipe.c2s) | {"model": "local"}
    options = LocalOptions(**chain, points=16, few=8)
    arm = of_count(twin, 5)
    model = options.untrained(twin, jax.random.key(0))
    scale = jnp.repeat(jnp.array([0.01, 0.02, 0.03]), 6)
    model = replace(model, process=replace(model.process, scale=scale))
    babbling = replace(recipe_named("best"), episodes=2).collect_options()
    begun = options.adapted(model, twin, arm, babbling, jax.random.key(1))
    straight = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (5, 1))
    np.testing.assert_allclose(
        begun.process.scale.reshape(5, 6)[jnp.array([0, 4]), 0], [0.01, 0.03], rtol=1e-5
    )
    assert float(begun.extrapolation(straight)) < 0.01 * arm.length


@pytest.mark.slow
def test_a_short_recording_makes_it_nearer(
    tiny_best_networks, recording, tiny_best_recipe
):
    other = replace(recording, arm=recording.arm, episodes=recording.episodes)
    begun = train_s2c2a(other, tiny_best_recipe, 0, start=tiny_best_networks)
    assert (
        begun.curves["C2S"][:, 2].min() < tiny_best_networks.curves["C2S"][:, 2].min()
    )
    np.testing.assert_array_equal(
        begun.c2a.network.weight_head, tiny_best_networks.c2a.network.weight_head
    )


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"sensing": "true"}, "sensing"),
        ({"coupled_cables": True}, "coupled_cables"),
        ({"control_rate": 20.0}, "control_rate"),
        (
            {"sensing_coupling": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))},
            "sensing_coupling",
        ),
    ],
)
def test_arms_of_another_make_are_refused(tiny_best_networks, change, key, twin):
    networks = replace(
        tiny_best_networks,
        recipe=replace(tiny_best_networks.recipe, encoders_alone=False),
    )
    with pytest.raises(StrategyError, match=f"has {key} "):
        transferred(networks, twin.model_copy(update=change))


def test_other_cables_and_actuation_are_refused(
    tiny_best_networks, make_arm, simulated
):
    with pytest.raises(StrategyError, match="has cable_count 4"):
        transferred(tiny_best_networks, make_arm(3, 4))
    with pytest.raises(StrategyError, match="has actuation 'tension'"):
        transferred(tiny_best_networks, simulated)


@pytest.mark.slow
def test_other_counts_are_refused_where_cables_are_not_felt(
    tiny_best_recipe, simulated
):
    model, fewer = (
        tiny_best_recipe.c2s.untrained(simulated, jax.random.key(0)),
        of_count(simulated, 2),
    )
    with pytest.raises(TrainingError, match="of 2; other counts"):
        tiny_best_recipe.c2s.adapted(
            model,
            simulated,
            fewer,
            tiny_best_recipe.collect_options(),
            jax.random.key(0),
        )


def test_networks_of_another_recipe_are_refused(
    tiny_networks, recording, tiny_best_recipe
):
    with pytest.raises(StrategyError, match="differs in c2s"):
        train_s2c2a(recording, tiny_best_recipe, 0, start=tiny_networks)


@pytest.mark.slow
def test_models_that_begin_from_nothing_say_so(tiny_networks: TrainedNetworks, twin):
    with pytest.raises(TrainingError, match="begin from nothing"):
        transferred(tiny_networks, twin)
