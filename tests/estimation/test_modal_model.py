"""The modal model against the simulated arm, over the payload, and identified again."""

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.estimation.modal_model import (
    LinearizedArm,
    ModalFactors,
    ModalTable,
    identify_modal_factors,
    modal_step,
    simulate,
)
from s2c2a.robots.simulation import SimulatedRobot

PERIOD = 0.1
TWIN = load_arm("twin_arm")


def ringing_frequency(payload) -> float:
    """Frequency of the simulated tip after a force on it is removed [Hz]."""
    robot = SimulatedRobot(TWIN, payload=payload)
    robot.open()
    rest = robot.sensors["cables"].low * 0.0
    robot.apply_force(np.array([0.1, 0.0, 0.0]))
    for _ in range(40):
        robot.step(rest)
    robot.apply_force(np.zeros(3))
    positions = []
    for _ in range(500):
        robot.advance(0.01)
        positions.append(robot.states()[-1, 0])
    signs = np.sign(np.array(positions) - np.mean(positions[-100:]))
    crossings = np.flatnonzero(np.diff(signs))
    return 0.5 / (np.diff(crossings[:8]).mean() * 0.01)


@pytest.mark.parametrize("payload", [0.0, 0.05, 0.1])
def test_the_first_mode_is_that_of_the_simulated_arm(payload):
    arm = LinearizedArm.of(TWIN).with_payload(payload)
    step = modal_step(arm, ModalFactors.nominal(), PERIOD)
    rates = np.log(np.linalg.eigvals(step.transition).astype(complex)) / PERIOD
    slowest = np.abs(rates).min() / (2.0 * np.pi)
    assert slowest == pytest.approx(ringing_frequency(payload), rel=0.2)


def test_vibration_decays_to_the_equilibrium():
    step = modal_step(LinearizedArm.of(TWIN), ModalFactors.nominal(), PERIOD)
    equilibrium = np.full(6, 0.1)
    state = np.zeros(12)
    for _ in range(300):
        state = step.transition @ state + step.input @ equilibrium
    np.testing.assert_allclose(state, np.r_[equilibrium, np.zeros(6)], atol=1e-6)


EQUILIBRIA = np.random.default_rng(0).normal(0, 0.1, (3, 20, 6)).repeat(10, axis=1)
SHAPE = (3, 200, 3, 2)


def simulated(equilibria, stiffness=1.0, damping=1.0) -> np.ndarray:
    """Bends of the linearized arm with such factors."""
    factors = ModalFactors(jnp.asarray(stiffness), jnp.asarray(damping))
    return simulate(modal_step(LinearizedArm.of(TWIN), factors, PERIOD), equilibria)


def test_factors_are_identified_again_from_a_simulation():
    bends = simulated(EQUILIBRIA, 0.7, 1.2)
    factors, without, remaining = identify_modal_factors(
        TWIN, EQUILIBRIA.reshape(SHAPE), bends.reshape(SHAPE)
    )
    assert float(factors.stiffness) == pytest.approx(0.7, rel=0.05)
    assert float(factors.damping) == pytest.approx(1.2, rel=0.1)
    assert remaining < 0.1 * without


def test_factors_fit_best_also_where_the_model_knows_the_vibration_already():
    """The filter simulates vibration in any case: nominal factors would be worse."""
    bends = simulated(EQUILIBRIA, 1.3, 1.2)
    factors, without, remaining = identify_modal_factors(
        TWIN, bends.reshape(SHAPE), bends.reshape(SHAPE)
    )
    assert remaining > without
    twice = simulated(bends)
    best = simulated(bends, factors.stiffness, factors.damping)
    assert np.abs(best - bends).mean() < 0.8 * np.abs(twice - bends).mean()


def test_unknown_bends_leave_the_nominal_factors():
    unknown = np.full((2, 100, 3, 2), np.nan)
    factors, *errors = identify_modal_factors(TWIN, np.zeros_like(unknown), unknown)
    assert (float(factors.stiffness), *errors) == (1.0, 0.0, 0.0)


def test_the_table_holds_the_modal_step_of_each_payload():
    factors = ModalFactors.nominal()
    table = ModalTable.of(TWIN, factors)
    payload = table.payloads[2]
    arm = LinearizedArm.of(TWIN).with_payload(float(payload))
    transition, inputs = table.at(payload)
    step = modal_step(arm, factors, TWIN.control_period)
    np.testing.assert_allclose(transition, step.transition, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(inputs, step.input, rtol=1e-3, atol=1e-4)
