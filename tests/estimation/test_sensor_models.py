"""Sensor models: Jacobians, predictions against the simulated arm, missing values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.arm.sensors import MAX_DELAY, Camera, Inertial, Raw, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.estimation.measurements import MeasurementReader
from s2c2a.estimation.sensor_models import (
    SENSOR_MODELS,
    ExpectedState,
    sensor_models_of,
)
from s2c2a.kinematics import bends_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.plugins.discovery import trust_code
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading


class StiffPCC(PCCForwardModel):
    """PCC that knows the stiffness of its cables."""

    def cable_stiffnesses(self):
        """See `ForwardModel`."""
        return np.full(len(self.lengths), 40.0)


@pytest.fixture(scope="module")
def arm():
    twin = load_arm("twin_arm")
    imu = Inertial(
        acceleration_noise=0, acceleration_bias=0, turn_noise_deg=0, turn_bias_deg=0
    )
    camera = Camera(noise=0, lost=0, sees="ends", rate=10, delay=0.2)
    return twin.model_copy(
        update={
            "sensing": "true",
            "sensors": Sensors(imu=imu, camera=camera),
            "motor": twin.motor.model_copy(update={"current_noise": 0.0}),
        }
    )


def sensors_of(arm, model=PCCForwardModel):
    return sensor_models_of(arm, model.of(arm), {})


def moved(expected: ExpectedState, change) -> ExpectedState:
    """The expected state after a change of the bends that is all bend bias."""
    return expected._replace(
        bends=expected.bends + change,
        bend_biases=expected.bend_biases + change,
        bias_change=expected.bias_change + change,
    )


def test_every_sensor_of_the_arm_file_has_a_model(arm):
    names = [sensor.name for sensor in sensors_of(arm, StiffPCC)]
    assert names == ["bends", "imu", "current", "camera"]
    assert len(SENSOR_MODELS) == 4


def test_an_arm_without_sensors_has_no_models():
    assert sensors_of(load_arm("twin_arm")) == ()


def test_jacobians_are_those_of_the_predictions(arm, at_rest):
    bends = jnp.asarray(np.random.default_rng(0).normal(0, 0.3, (3, 2)), jnp.float32)
    expected = at_rest(arm, bends)
    for sensor in sensors_of(arm, StiffPCC):
        measured = {
            name: jnp.full(value.shape, 0.1) for name, value in sensor.missing().items()
        }

        def residual(change, sensor=sensor, measured=measured):
            state = moved(expected, change.reshape(3, 2))
            return sensor.innovation(measured, state).residual

        innovation = sensor.innovation(measured, expected)
        derivative = jax.jacfwd(residual)(jnp.zeros(6))
        np.testing.assert_allclose(
            innovation.jacobian, -derivative, atol=2e-4, err_msg=sensor.name
        )


def test_a_bent_simulated_arm_measures_what_is_predicted(arm, at_rest):
    robot = SimulatedRobot(arm)
    robot.open()
    sensors = sensors_of(arm)
    reader = MeasurementReader(arm, sensors)
    reader.measurements(robot.read())
    bends = np.array([[0.5, 0.2], [0.3, -0.3], [-0.2, 0.4]])
    action = ArmGeometry.of(arm).actions_at(bends)
    for _ in range(80):
        robot.step(action)
        measured = reader.measurements(robot.read())
    configurations = jnp.asarray(robot.configurations(), jnp.float32)
    expected = at_rest(arm, bends_from_configurations(configurations))
    states = jnp.asarray(robot.states(), jnp.float32)
    expected = expected._replace(
        past_states=jnp.broadcast_to(states, expected.past_states.shape)
    )
    for sensor in sensors:
        values = {name: jnp.asarray(measured[name]) for name in sensor.missing()}
        residual = sensor.innovation(values, expected).residual
        assert np.abs(residual).max() < 0.02, sensor.name  # false for NaN


def test_pictures_that_are_too_old_are_not_used(arm, at_rest):
    (camera,) = (sensor for sensor in sensors_of(arm) if sensor.name == "camera")
    expected = at_rest(arm, jnp.zeros((3, 2)))
    usable = []
    for age in (0.0, MAX_DELAY, MAX_DELAY + 0.2, -0.1):
        measured = {
            "camera_positions": jnp.zeros((3, 3)),
            "camera_age": jnp.asarray(age),
        }
        residual = camera.innovation(measured, expected).residual
        usable.append(bool(jnp.isfinite(residual).all()))
    assert usable == [True, True, False, False]


def test_a_repeated_age_is_used_and_a_repeated_picture_is_missing(arm):
    reader = MeasurementReader(arm, sensors_of(arm))
    values = {"camera_age": np.asarray(0.1), "camera_positions": np.ones((3, 3))}
    measured = [reader.measurements(Reading(0.1 * step, values)) for step in range(2)]
    assert [float(one["camera_age"]) for one in measured] == pytest.approx([0.1, 0.1])
    assert np.isfinite(measured[0]["camera_positions"]).all()
    assert np.isnan(measured[1]["camera_positions"]).all()


@pytest.mark.parametrize("values", [{}, np.zeros(3), "no", None, np.full((3, 3), "a")])
def test_missing_and_malformed_values_become_nan(arm, values):
    reader = MeasurementReader(arm, sensors_of(arm))
    measured = reader.measurements(Reading(0.0, {"camera_positions": values}))
    assert np.isnan(measured["camera_positions"]).all()


def test_a_formula_that_is_no_sensor_model_is_refused(arm):
    model = "collections:OrderedDict"
    trust_code(model)
    raw = Raw(name="strings", shape=(3, 2), model=model)
    changed = arm.model_copy(update={"sensors": Sensors(raw=(raw,))})
    with pytest.raises(
        S2C2AError, match=r"is no sensor model; derive it from s2c2a\..*FormulaSensor"
    ):
        sensors_of(changed)
