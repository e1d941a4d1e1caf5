"""Sensors: slopes are those of what is expected, and what is expected is what a body that stands so says."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from s2c2a.estimation.listening import Listener
from s2c2a.estimation.sensors import LATEST, Shape, sensors_of

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.arm.sensors import Camera, Inertial, Sensors
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    states_from_bends,
)
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading

BEFORE = 9  # steps


@pytest.fixture(scope="module")
def arm():
    twin = load_arm("twin_arm")
    motor = twin.motor.model_copy(update={"current_noise": 0.0})
    quiet = Inertial(
        acceleration_noise=0, acceleration_bias=0, turn_noise_deg=0, turn_bias_deg=0
    )
    sensors = Sensors(
        imu=quiet, camera=Camera(noise=0, lost=0, sees="ends", rate=10, delay=0.2)
    )
    return twin.model_copy(
        update={"sensing": "true", "sensors": sensors, "motor": motor}
    )


def standing(arm, bends) -> Shape:
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
    states = states_from_bends(bends, lengths)
    none = jnp.zeros((BEFORE, *bends.shape))
    tensions = jnp.full((arm.module_count, arm.cable_count), 5.0)
    past = (
        jnp.broadcast_to(bends, none.shape),
        jnp.broadcast_to(states, (BEFORE, *states.shape)),
    )
    return Shape(bends, 0.0 * bends, tensions, *past, none)


def moved(shape: Shape, way) -> Shape:
    return shape._replace(
        bends=shape.bends + way, leans=shape.leans + way, since=shape.since + way
    )


def test_slopes_are_those_of_what_is_expected(arm):
    bends = jnp.asarray(np.random.default_rng(0).normal(0, 0.3, (3, 2)), jnp.float32)
    for sense in sensors_of(arm, ArmGeometry.of(arm).cable_springs * 100.0):
        said = {
            name: jnp.full(value.shape, 0.5) for name, value in sense.silent().items()
        }
        shape = standing(arm, bends)
        there = jax.jacfwd(
            lambda way: sense.off(said, moved(shape, way.reshape(3, 2))).numbers
        )(jnp.zeros(6))
        np.testing.assert_allclose(
            sense.off(said, shape).slopes, -there, atol=2e-4, err_msg=sense.name
        )


def test_a_bent_arm_at_rest_says_what_is_expected_of_it(arm):
    robot = SimulatedRobot(arm)
    robot.open()
    listener = Listener(arm, sensors_of(arm, ArmGeometry.of(arm).cable_springs))
    listener.heard(robot.read())
    action = ArmGeometry.of(arm).actions_at(
        np.array([[0.5, 0.2], [0.3, -0.3], [-0.2, 0.4]])
    )
    for _ in range(80):
        robot.step(action)
        heard = listener.heard(robot.read())
    bends = bends_from_configurations(jnp.asarray(robot.configurations(), jnp.float32))
    shape = standing(arm, bends)
    shape = shape._replace(
        states_before=jnp.broadcast_to(
            jnp.asarray(robot.states(), jnp.float32), (BEFORE, 3, 6)
        )
    )
    for sense in sensors_of(arm, None):
        off = sense.off(
            {name: jnp.asarray(heard[name]) for name in sense.silent()}, shape
        )
        assert np.abs(off.numbers).max() < 0.02, sense.name  # and finite


def test_pictures_older_than_is_remembered_are_not_heard(arm):
    (camera,) = (sense for sense in sensors_of(arm, None) if sense.name == "camera")
    heard = [
        camera.off(
            {"camera_positions": jnp.zeros((3, 3)), "camera_age": jnp.asarray(age)},
            standing(arm, jnp.zeros((3, 2))),
        ).numbers
        for age in (0.0, LATEST, LATEST + 0.2, -0.1)
    ]
    assert [bool(jnp.isfinite(numbers).all()) for numbers in heard] == [
        True,
        True,
        False,
        False,
    ]


def test_the_same_age_again_is_still_an_age(arm):
    listener = Listener(arm, sensors_of(arm, None))
    ages = [
        listener.heard(Reading(0.1 * step, {"camera_age": np.asarray(0.1)}))[
            "camera_age"
        ]
        for step in range(2)
    ]
    np.testing.assert_allclose(ages, 0.1)


@pytest.mark.parametrize("absurd", [1e30, 1e9, -1e3])
def test_absurd_numbers_of_inertial_sensors_are_not_heard(arm, absurd):
    listener = Listener(arm, sensors_of(arm, None))
    down = np.tile([0.0, 0.0, -9.81], (10, 3, 1))
    listener.heard(
        Reading(0.0, {"accelerations": down, "angular_velocities": 0.0 * down})
    )
    said = {
        "accelerations": np.full_like(down, absurd),
        "angular_velocities": 0.0 * down,
    }
    assert np.isnan(listener.heard(Reading(0.1, said))["inclinations"]).all()
    again = listener.heard(
        Reading(0.2, {"accelerations": down + 0.05, "angular_velocities": 0.0 * down})
    )
    np.testing.assert_allclose(again["inclinations"][:, 2], 1.0, atol=1e-3)


def test_what_is_missing_broken_or_frozen_is_not_heard(arm):
    listener = Listener(arm, sensors_of(arm, None))
    assert np.isnan(listener.heard(Reading(0.0, {}))["configurations"]).all()
    straight = np.tile([0.0, 0.0, 1.0], (3, 1))
    for broken in (
        straight[:2],
        "no",
        np.full((3, 3), np.nan),
        np.array([["a"] * 3] * 3),
    ):
        heard = listener.heard(Reading(0.0, {"configurations": broken}))
        np.testing.assert_array_equal(heard["configurations"], np.full((3, 3), np.nan))
    heard = [
        listener.heard(Reading(0.1 * step, {"configurations": straight}))
        for step in range(2)
    ]
    assert np.isfinite(heard[0]["configurations"]).all()
    assert np.isnan(heard[1]["configurations"]).all()
    bent = np.asarray(configurations_from_bends(jnp.full((3, 2), 0.1)))
    assert np.isfinite(
        listener.heard(Reading(0.9, {"configurations": bent}))["configurations"]
    ).all()
