"""Sensors whose numbers are learned: what they said is found again, files keep it, and what fails is left out."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from s2c2a.estimation.learned_sensors import PREFIX
from s2c2a.estimation.listening import Listener
from s2c2a.estimation.sensors import Shape

from s2c2a.arm import arm_from_toml, arm_to_toml, load_arm
from s2c2a.arm.sensors import Flex, Raw, Sensors
from s2c2a.errors import ArmError, TrainingError
from s2c2a.estimation import (
    Heard,
    Observer,
    Swing,
    gains_of,
    learn_numbers,
    learned_sensors,
    untrained_sensors,
)
from s2c2a.kinematics import states_from_bends
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import load_strategy, observer_of, save_strategy, shipped_networks

EPISODES, SAMPLES, PLAY, ZERO = 4, 400, 0.03, 0.1
KEY = jax.random.key(0)
OWN = Raw(name="pressure", shape=(2, 2))


@pytest.fixture(scope="module")
def arm():
    return load_arm("twin_arm").model_copy(
        update={"sensors": Sensors(flex=Flex(), raw=(OWN,))}
    )


def pressures(bends):
    """Two pairs of numbers of three modules, in a unit of theirs."""
    x = bends.reshape(*bends.shape[:2], 6)
    pairs = [
        x[..., 0] + 0.3 * x[..., 3],
        x[..., 1] ** 2,
        x[..., 4] - 0.2 * x[..., 0],
        np.tanh(2.0 * x[..., 5]),
    ]
    return 50.0 * np.stack(pairs, axis=-1).reshape(*bends.shape[:2], 2, 2)


@pytest.fixture(scope="module")
def bends():
    times = 0.1 * np.arange(SAMPLES)
    random = np.random.default_rng(0)
    rates, phases = random.uniform(0.3, 1.5, (2, EPISODES, 1, 6))
    return (0.6 * np.sin(rates * times[:, None] + 4.0 * phases)).reshape(
        EPISODES, SAMPLES, 3, 2
    )


@pytest.fixture(scope="module")
def heard(bends):
    zeros = 50.0 * ZERO * np.random.default_rng(1).normal(size=(EPISODES, 1, 2, 2))
    noise = 0.5 * np.random.default_rng(2).normal(size=(EPISODES, SAMPLES, 2, 2))
    return Heard.of(bends, pressures(bends) + zeros + noise)


@pytest.fixture(scope="module")
def learned(arm, heard):
    return learn_numbers(arm, heard, KEY)


@pytest.fixture(scope="module")
def sense(arm, learned):
    return learned_sensors(arm, {f"{PREFIX}pressure": learned.network})[0]


def standing(sense, bends) -> Shape:
    """At rest, where it stays."""
    none = jnp.zeros((2, 3, 2))
    return Shape(
        bends,
        0.0 * bends,
        jnp.zeros((3, 3)),
        none,
        jnp.zeros((2, 3, 6)),
        none,
        sense.lagging(bends),
    )


def test_what_a_sensor_says_of_bends_is_learned_whatever_its_zeros_were(
    sense, learned, bends
):
    said = np.asarray(
        jax.vmap(sense.numbers)(jnp.asarray(bends[0].reshape(-1, 6), jnp.float32))
    )
    off = said - pressures(bends)[0].reshape(-1, 4)
    assert (off - off.mean(axis=0)).std() < 3.0  # of 100 that they range over
    assert learned.percent[0] < 4.0
    assert 2.0 < np.mean(learned.network.errors.first) < 12.0  # zeros were off by 5


def test_slopes_are_those_of_what_is_expected(sense):
    there = jnp.asarray(np.random.default_rng(3).normal(0, 0.3, (3, 2)), jnp.float32)
    said = {"pressure": jnp.zeros((2, 2))}

    def numbers(way):
        moved = there + way.reshape(3, 2)
        return sense.off(said, standing(sense, moved)).numbers

    slopes = sense.off(said, standing(sense, there)).slopes
    np.testing.assert_allclose(slopes, -jax.jacfwd(numbers)(jnp.zeros(6)), atol=1e-3)


def test_play_is_found_and_understood(arm, bends):
    straight = bends.reshape(EPISODES, SAMPLES, 6)[..., :2]
    said = straight.copy()
    for now in range(1, SAMPLES):
        said[:, now] = np.clip(
            said[:, now - 1], straight[:, now] - PLAY, straight[:, now] + PLAY
        )
    found = learn_numbers(arm, Heard.of(bends, said), KEY).network.errors
    np.testing.assert_allclose(found.play, PLAY, rtol=0.5)
    assert np.max(found.spread) < PLAY / 2


def test_strips_of_a_bent_arm_say_it_each_in_its_own_way():
    perfect = {
        "gain_error": 0,
        "nonlinearity": 0,
        "angle_error_deg": 0,
        "crosstalk": 0,
        "hysteresis": 0,
        "noise": 0,
    }
    quiet = Flex(**perfect, zero_error=0, drift=0)
    twin = load_arm("twin_arm")

    def read(part, seed=0):
        robot = SimulatedRobot(
            twin.model_copy(update={"sensors": Sensors(flex=part)}),
            seed=seed,
            payload=0.2,
        )
        robot.open()
        robot.push(np.array([0.3, 0.0, 0.0]))
        for _ in range(20):
            robot.step(0.0 * robot.read()["cables"])
        return robot.configurations(), robot.read()["flex"]

    configurations, said = read(quiet)
    bent = np.arctan2(configurations[:, 0], configurations[:, 2])
    assert np.abs(bent).max() > 0.05
    np.testing.assert_allclose(said[:, 0], bent, atol=0.01)
    # three, evenly round a module
    np.testing.assert_allclose(said.sum(axis=1), 0.0, atol=1e-6)
    uneven = quiet.model_copy(update={"gain_error": 0.3})
    # strips stay
    np.testing.assert_array_equal(read(uneven)[1], read(uneven, seed=5)[1])
    assert (
        np.abs(read(uneven)[1] - read(uneven.model_copy(update={"strips": 1}))[1]).max()
        > 0.01
    )


def test_a_zero_is_found_at_rest_and_a_jump_is_left_out(arm, sense):
    observer = Observer.of(arm, gains_of(arm, Swing.nominal()), (sense,))
    model, straight = (
        PCCForwardModel.of(arm),
        jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1)),
    )
    states = states_from_bends(
        jnp.zeros((3, 2)), jnp.asarray([module.length for module in arm.modules])
    )
    belief, memory = observer.start(states, jnp.asarray(0.0)), model.start(straight)
    update = eqx.filter_jit(
        lambda belief, said: observer.update(
            belief, model, memory, straight, straight, said
        )[0]
    )
    said = sense.numbers(jnp.zeros(6)).reshape(2, 2) + 4.0
    for _ in range(30):
        belief = update(belief, {"pressure": said})
    np.testing.assert_allclose(belief.mean[observer.zeros_of(0, 6)], 4.0, atol=1.5)
    assert belief.left_out[0] == 0.0
    broken = update(belief, {"pressure": said + 400.0})
    assert broken.left_out[0] > 0.0
    missing = update(belief, {"pressure": jnp.full((2, 2), jnp.nan)})
    assert np.isfinite(np.concatenate([broken.mean, missing.mean])).all()


def test_what_is_missing_or_of_another_shape_is_not_heard(arm, sense):
    listener = Listener(arm, (sense,))
    for said in ({}, {"pressure": np.zeros(3)}, {"pressure": "no"}):
        assert np.isnan(listener.heard(Reading(0.0, said))["pressure"]).all()
    assert np.isfinite(
        listener.heard(Reading(0.1, {"pressure": np.ones((2, 2))}))["pressure"]
    ).all()


def test_too_little_to_learn_from_is_refused(arm, bends):
    with pytest.raises(TrainingError, match="too few"):
        learn_numbers(
            arm, Heard.of(bends[:, :20], np.full((EPISODES, 20, 1), np.nan)), KEY
        )


def test_a_number_that_is_never_said_spoils_no_other(arm, bends):
    said = np.concatenate(
        [bends[..., :1, 0], np.full((*bends.shape[:2], 1), np.nan)], axis=-1
    )
    found = learn_numbers(arm, Heard.of(bends, said), KEY).network
    assert all(
        np.isfinite(leaf).all()
        for leaf in jax.tree.leaves(eqx.filter(found, eqx.is_array))
    )


def test_files_keep_what_was_learned_and_do_without(arm, learned, tmp_path):
    plain = shipped_networks(load_arm("twin_arm"))
    name = f"{PREFIX}pressure"
    both = replace(
        plain,
        arm=arm,
        networks={**plain.networks, name: learned.network},
        percent={**plain.percent, name: learned.percent},
        curves={**plain.curves, name: learned.curve},
    )
    save_strategy(both, tmp_path / "both.safetensors")
    save_strategy(replace(plain, arm=arm), tmp_path / "without.safetensors")
    kept, without = (
        load_strategy(tmp_path / f"{one}.safetensors", arm)
        for one in ("both", "without")
    )
    assert [one.name for one in observer_of(kept).sensors] == ["pressure"]
    assert observer_of(without).sensors == ()
    at = jnp.linspace(-0.5, 0.5, 6)
    np.testing.assert_array_equal(kept.networks[name](at), learned.network(at))


def test_arm_files_say_it_and_names_are_ones_own(arm):
    assert arm_from_toml(arm_to_toml(arm)) == arm
    assert set(untrained_sensors(arm, KEY)) == {f"{PREFIX}flex", f"{PREFIX}pressure"}
    twice = arm_to_toml(arm).replace('name = "pressure"', 'name = "flex"')
    with pytest.raises(ArmError, match="taken"):
        arm_from_toml(twice)
    with pytest.raises(ArmError, match="numbers"):
        arm_from_toml(
            arm_to_toml(arm).replace("    2,\n    2,\n", "    200,\n    200,\n")
        )
