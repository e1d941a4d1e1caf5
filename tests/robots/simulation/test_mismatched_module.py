"""Model mismatch of the simulation: each parameter against an analytical result."""

import numpy as np
import pytest

from held_arm import bends, settled
from s2c2a.arm import ArmGeometry, Mismatch
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot

EI, LENGTH, RADIUS, CABLES = 0.16, 0.2, 0.027, 4
PULL = {"actuation": "tension", "gravity_direction": (0.0, 0.0, 0.0), "cables": CABLES}


@pytest.fixture
def pulled_arm(make_arm):
    """Return a builder of weightless tension arms of four cables with mismatch."""

    def make(modules: int = 1, pretension: float = 0.0, **mismatch):
        module = {
            "tension_range": 40.0,
            "pretension": pretension,
            "damping_time": 0.02,
            "mismatch": Mismatch(**mismatch),
        }
        return make_arm(modules=modules, module=module, **PULL)

    return make


def bend_of(tension: float, stiffness: float = EI, radius: float = RADIUS) -> float:
    """Of a module that one cable pulls: T r L / EI."""
    return tension * radius * LENGTH / stiffness


def test_cables_act_at_their_true_angles_and_radii(pulled_arm, fidelity):
    mismatch = {
        "angle_errors_deg": (7.0, 0.0, 0.0, 0.0),
        "radius_errors": (0.1, 0.0, 0.0, 0.0),
    }
    (bend,) = bends(settled(pulled_arm(**mismatch), [[10.0, 0.0, 0.0, 0.0]], fidelity))
    assert np.rad2deg(np.arctan2(bend[1], bend[0])) == pytest.approx(7.0, abs=0.1)
    assert np.linalg.norm(bend) == pytest.approx(
        bend_of(10.0, radius=1.1 * RADIUS), rel=0.01
    )


def test_cables_through_a_module_below_bend_it_by_their_radius_there(
    pulled_arm, fidelity
):
    robot = settled(
        pulled_arm(modules=2, coupling=0.25),
        [[0.0] * CABLES, [10.0, 0.0, 0.0, 0.0]],
        fidelity,
    )
    below, own = bends(robot)
    assert own[0] == pytest.approx(bend_of(10.0), rel=0.01)
    assert below[0] == pytest.approx(bend_of(10.0, radius=RADIUS / 4), rel=0.02)


def test_coupling_at_the_whole_radius_is_that_of_coupled_cables(pulled_arm, fidelity):
    tensions = [[0.0, 0.0, 0.0, 5.0], [8.0, 0.0, 0.0, 0.0]]
    inside, coupled = pulled_arm(modules=2, coupling=1.0), pulled_arm(modules=2)
    coupled = coupled.model_copy(update={"coupled_cables": True})
    pair = [settled(arm, tensions, fidelity).states() for arm in (inside, coupled)]
    np.testing.assert_array_equal(*pair)


def test_a_straight_arm_with_coupling_has_cables_of_no_tension(make_arm, fidelity):
    """The rest length includes the step outward where a cable enters its own module."""
    arm = make_arm(
        module={"mismatch": Mismatch(coupling=0.25)}, gravity_direction=(0.0, 0.0, 0.0)
    )
    robot = SimulatedRobot(arm, fidelity)
    robot.open()
    np.testing.assert_allclose(robot.tensions(), 0, atol=1e-6)


@pytest.mark.parametrize("direction", [0.0, 30.0])
def test_bends_along_and_across_the_stiff_direction_differ_by_the_ratio(
    pulled_arm, fidelity, direction
):
    mismatch = {
        "stiffness_ratio": 1.5,
        "stiff_direction_deg": direction,
        "angle_errors_deg": direction,
    }
    along, across = (
        np.linalg.norm(bends(settled(pulled_arm(**mismatch), [tensions], fidelity))[0])
        for tensions in ([8.0, 0.0, 0.0, 0.0], [0.0, 8.0, 0.0, 0.0])
    )
    assert across / along == pytest.approx(1.5, rel=0.01)
    assert np.sqrt(across * along) == pytest.approx(bend_of(8.0), rel=0.01)


def test_hardening_is_the_stiffness_increase_at_full_bend(pulled_arm, fidelity):
    """1.2 times the moment of a linear module at full bend bends this one fully."""
    arm = pulled_arm(hardening=0.2)
    full = ArmGeometry.of(arm).bend_limits[0]
    tension = 1.2 * full * EI / (RADIUS * LENGTH)
    (bend,) = bends(settled(arm, [[tension, 0.0, 0.0, 0.0]], fidelity))
    assert np.linalg.norm(bend) == pytest.approx(full, rel=0.015)


def test_stiffness_and_mass_errors_change_bend_and_mass(pulled_arm):
    arm = pulled_arm(stiffness_error=0.25, mass_error=0.1)
    robot = settled(arm, [[10.0, 0.0, 0.0, 0.0]])
    assert bends(robot)[0, 0] == pytest.approx(bend_of(10.0, 1.25 * EI), rel=0.01)
    plain = SimulatedRobot(pulled_arm()).model.body_mass
    np.testing.assert_allclose(robot.model.body_mass[1:], 1.1 * plain[1:])


def test_a_held_bend_creeps_as_the_maxwell_elements_predict(pulled_arm, fidelity):
    """Compare with the creep compliance of two Maxwell elements beside a spring."""
    parts, times = np.array([0.1, 0.2]), np.array([1.0, 8.0])
    steady, arm = (
        pulled_arm(**mismatch)
        for mismatch in (
            {},
            {"relaxing": tuple(parts), "relaxation_times": tuple(times)},
        )
    )
    robot, held = SimulatedRobot(arm, fidelity), [[10.0, 0.0, 0.0, 0.0]]
    robot.open()
    seen = [robot.step(held) is None or bends(robot)[0, 0] for _ in range(300)]
    at_first = bends(settled(steady, held, fidelity))[0, 0]
    # q - sum s z = M / k and tau z' = q - z, so tau_i z_i' = 1 + sum_j s_j z_j - z_i in
    # units of M / k
    matrix = (np.outer(np.ones(2), parts) - np.eye(2)) / times[:, None]
    poles, ways = np.linalg.eig(matrix)
    rest = -np.linalg.solve(matrix, 1 / times)

    def at(seconds):
        decay = np.exp(poles * seconds) * np.linalg.solve(ways, rest)
        return rest - ways @ decay

    for step in (40, 100, 299):
        assert seen[step] / at_first == pytest.approx(
            1 + parts @ at(0.1 * (step + 1)), abs=0.005
        )
    assert 1 + parts @ rest == pytest.approx(1 / 0.7)


def test_a_relaxed_arm_recovers_at_its_next_opening(pulled_arm):
    robot = settled(
        pulled_arm(relaxing=(0.3, 0.3)), [[10.0, 0.0, 0.0, 0.0]], seconds=10.0
    )
    robot.open()
    np.testing.assert_allclose(bends(robot), 0, atol=1e-6)


def test_a_new_payload_keeps_the_relaxation(pulled_arm):
    robot = settled(
        pulled_arm(relaxing=(0.3, 0.3)), [[10.0, 0.0, 0.0, 0.0]], seconds=20.0
    )
    before = bends(robot)
    robot.set_payload(0.01)
    robot.step([[10.0, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(bends(robot), before, rtol=2e-3)


def test_cables_shorten_the_center_line_by_their_tension_over_its_stiffness(
    pulled_arm, fidelity
):
    robot = settled(pulled_arm(axial_stiffness=1000.0), [[10.0] * CABLES], fidelity)
    assert robot.states()[0, 2] == pytest.approx(
        LENGTH * (1 - 4 * 10.0 / 1000.0), abs=1e-5
    )


def test_all_cables_through_a_module_shorten_it_and_those_in_tubes_do_not(
    pulled_arm, fidelity
):
    tensions = [[0.0] * CABLES, [10.0] * CABLES]
    for coupling, shares in ((0.0, (0.04, 0.04)), (None, (0.0, 0.04))):
        robot = settled(
            pulled_arm(modules=2, axial_stiffness=1000.0, coupling=coupling),
            tensions,
            fidelity,
        )
        np.testing.assert_allclose(
            robot.states()[:, 2], LENGTH * np.cumsum(1 - np.array(shares)), atol=2e-5
        )


def test_a_cable_that_runs_through_a_shortened_module_gets_shorter_with_it(
    make_arm, fidelity
):
    """The proximal module shortens, so the distal module's cables go slack."""
    arm = make_arm(
        modules=2,
        gravity_direction=(0.0, 0.0, 0.0),
        module={
            "pretension": 2.0,
            "cable": {"stiffness": 5000.0},
            "mismatch": {"axial_stiffness": 500.0, "coupling": 0},
        },
    )
    robot = settled(arm, [[-0.004] * 3, [0.0] * 3], fidelity)
    shortened = 2 * LENGTH - robot.states()[1, 2]
    assert shortened > 0.003
    np.testing.assert_allclose(
        robot.tensions()[1], np.maximum(2.0 - 5000.0 * shortened, 0.0), atol=0.01
    )


def test_without_force_a_module_has_its_rest_bend(pulled_arm, fidelity):
    mismatch = {
        "rest_bend_deg": 6.0,
        "rest_azimuth_deg": 40.0,
        "stiffness_ratio": 1.3,
        "stiff_direction_deg": 25.0,
    }
    (bend,) = bends(settled(pulled_arm(**mismatch), [[0.0] * CABLES], fidelity))
    assert np.rad2deg(np.linalg.norm(bend)) == pytest.approx(6.0, abs=0.05)
    assert np.rad2deg(np.arctan2(bend[1], bend[0])) == pytest.approx(40.0, abs=0.5)


def test_an_arm_without_mismatch_has_no_additional_joints(twin, fidelity):
    model = SimulatedRobot(twin, fidelity).model
    hinges = FIDELITIES[fidelity].segments * (3 if FIDELITIES[fidelity].torsion else 2)
    assert model.njnt == model.nv == 3 * hinges
    assert not model.qpos_spring.any()
    assert not model.jnt_stiffnesspoly.any()
