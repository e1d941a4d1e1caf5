"""A mass at the tip that belongs to the arm: as a payload that is always there."""

import numpy as np
import pytest

from held_arm import settled
from s2c2a.arm import ArmGeometry, ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.estimation.modal_model import LinearizedArm
from s2c2a.lab.tracking.arcs import ArcChain
from s2c2a.models.disturbances import moments_of_weights
from s2c2a.models.trunk import Trunk
from s2c2a.robots.simulation.modes import first_mode

MASS = 0.05  # kg
ACROSS = np.array([9.81, 0.0, 0.0])  # m/s2


def carrying(arm: ArmSpec, mass: float = MASS) -> ArmSpec:
    return arm_from_toml(f"{arm_to_toml(arm)}\n[tip]\nmass = {mass}\n")


def states_of(arm: ArmSpec, payload: float) -> np.ndarray:
    """States of the simulated arm after holding a bend for three seconds."""
    action = ArmGeometry.of(arm).actions_at(np.full((3, 2), 0.3))
    return settled(arm, action, seconds=3.0, payload=payload).states()


def test_the_simulated_arm_sags_as_with_a_payload_and_a_payload_adds_to_it(twin):
    straight = states_of(twin, 0.0)
    sagging = states_of(twin, MASS)
    assert np.linalg.norm(sagging[-1, :3] - straight[-1, :3]) > 0.01
    np.testing.assert_allclose(states_of(carrying(twin), 0.0), sagging, atol=1e-9)
    both = states_of(carrying(twin), 0.03)
    np.testing.assert_allclose(both, states_of(twin, MASS + 0.03), atol=1e-9)


def test_statics_of_the_model_have_its_moments(twin):
    bends = np.full((3, 2), 0.3)

    def moments(weights):
        shape = bends, Trunk.of(twin).lengths, Trunk.of(twin).compliances
        return np.asarray(moments_of_weights(weights, *shape, ACROSS))

    payload = MASS * moments(np.array([0.0, 0.0, 1.0]))
    assert np.abs(payload).max() > 0.01
    added = moments(Trunk.of(carrying(twin)).weights) - moments(Trunk.of(twin).weights)
    np.testing.assert_allclose(added, payload, rtol=1e-4, atol=1e-7)


def test_it_slows_the_first_mode_and_deflects_arcs(twin):
    loaded = carrying(twin)
    known = LinearizedArm.of(twin).with_payload(MASS)
    np.testing.assert_allclose(LinearizedArm.of(loaded).masses, known.masses)
    assert first_mode(loaded)[0] < 0.9 * first_mode(twin)[0]
    added = ArcChain.of(loaded).weights - ArcChain.of(twin).weights
    np.testing.assert_allclose(added, [MASS * np.array(twin.gravity)] * 3)


def test_files_and_digests_of_arms_without_it_stay_the_same(twin):
    assert "tip" not in arm_to_toml(twin)
    assert carrying(twin, 0.0) == twin
    loaded = carrying(twin)
    assert loaded.mass == pytest.approx(twin.mass + MASS)
    assert twin.differences(loaded) == [f"tip None, now {{'mass': {MASS}}}"]
