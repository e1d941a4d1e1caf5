"""Equilibrium of the cable model in cases solved by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cable_parameters import straight_arm, wiring_of

from s2c2a.logs import model_fit
from s2c2a.logs.cable_model import equilibrium_bends, gravity_matrix, tilt_rotation
from s2c2a.logs.model_fit import flatten, unflatten

STIFFNESS = 0.5
WIRING = wiring_of(1)
PARAMETERS = straight_arm([0.1], stiffness=np.array(np.log(STIFFNESS)))


@pytest.fixture(autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


@pytest.mark.slow
def test_one_taut_cable_bends_against_the_stiffness_of_the_arm():
    # (stiffness + 1) bend = pull, because the other two cables are slack
    columns = np.array([[0.3, -1.0, -1.0]])
    bends = equilibrium_bends(PARAMETERS, WIRING, columns, tension=False)
    np.testing.assert_allclose(bends[0, 0], [0.3 / (1 + STIFFNESS), 0], atol=1e-12)


def test_tensions_bend_against_the_stiffness_of_the_arm_alone():
    columns = np.array([[0.3, 0.0, 0.0]])
    bends = equilibrium_bends(PARAMETERS, WIRING, columns, tension=True)
    np.testing.assert_allclose(bends[0, 0], [0.3 / STIFFNESS, 0], atol=1e-12)


@pytest.mark.slow
def test_gradients_equal_finite_differences():
    columns = np.array([[0.3, -0.1, -0.2]])

    def bend(gain):
        parameters = PARAMETERS._replace(gain=gain)
        return equilibrium_bends(parameters, WIRING, columns, tension=False)[0, 0, 0]

    difference = float(bend(1e-6) - bend(-1e-6)) / 2e-6
    assert float(jax.grad(bend)(0.0)) == pytest.approx(difference, rel=1e-6)


def test_gravity_is_symmetric_and_strongest_on_the_innermost_module():
    matrix = gravity_matrix(3)
    np.testing.assert_allclose(matrix, matrix.T)
    assert matrix[0, 0] == matrix.max() == 1.0


def test_a_small_tilt_is_a_rotation_about_x_and_y():
    rotation = tilt_rotation(jnp.array([1e-4, 2e-4]))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation[:, 2], [2e-4, -1e-4, 1.0], atol=1e-7)


def test_parameters_survive_flattening():
    back = unflatten(flatten(PARAMETERS), PARAMETERS)
    for value, original in zip(back, PARAMETERS, strict=True):
        np.testing.assert_array_equal(value, original)


def test_a_long_log_is_predicted_in_parts(monkeypatch):
    columns = np.random.default_rng(0).uniform(-0.3, 0.3, (23, 3))
    whole = model_fit.predict_states(PARAMETERS, WIRING, columns, False)
    monkeypatch.setattr(model_fit, "PART", 7)
    parts = model_fit.predict_states(PARAMETERS, WIRING, columns, False)
    for name, expected, found in zip(("bends", "states"), whole, parts, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12, err_msg=name)
