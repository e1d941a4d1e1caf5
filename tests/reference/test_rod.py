"""The rod reference against printed tips, answers worked by hand and symmetries."""

import numpy as np
import pytest

from s2c2a.errors import ActionError, SimulationError

from marks import slow_after
from rod import _curvature, _segments, rod_shape
from rod_cases import rod_cases

CASES = {case.name: case for case in rod_cases()}
A_THIRD_TURN = np.array([[-0.5, -(0.75**0.5), 0], [0.75**0.5, -0.5, 0], [0, 0, 1]])
NO_FORCE = np.zeros(3)


def arm_like_case_a(**changes):
    """The weightless arm with the given fields changed."""
    return CASES["A"].arm.model_copy(update=changes)


def module_like_case_a(**changes):
    """The base module with the given fields changed."""
    return CASES["A"].arm.modules[0].model_copy(update=changes)


@pytest.mark.parametrize("case", slow_after(1, rod_cases()))
def test_the_tip_agrees_with_separate_code(case):
    states = rod_shape(case.arm, case.tensions, case.tip_force)
    np.testing.assert_allclose(states[-1, :3], case.tip, atol=2e-6)


def test_the_curvature_of_a_cross_section_makes_its_energy_stationary():
    """Energy per length: u K u / 2 - m u, plus tension times cable length |v|."""
    module = module_like_case_a(torsional_stiffness=0.02)
    arm, pulls, moment = (
        arm_like_case_a(modules=(module,)),
        np.array([9.0, 1, 4]),
        np.array([0.2, -0.1, 0.05]),
    )
    angles = np.deg2rad(module.cable_angles_deg)
    cables = module.cable_radius * np.stack(
        [np.cos(angles), np.sin(angles), 0 * angles], axis=-1
    )

    def energy(u):
        lengths = np.linalg.norm(np.array([0, 0, 1]) + np.cross(u, cables), axis=-1)
        return np.array([0.05, 0.05, 0.02]) @ u**2 / 2 - moment @ u + pulls @ lengths

    u = _curvature(_segments(arm, pulls[None], NO_FORCE)[0], moment[None])[0]
    slope = [(energy(u + step) - energy(u - step)) / 2e-4 for step in 1e-4 * np.eye(3)]
    np.testing.assert_allclose(slope, 0, atol=1e-8)


def test_a_module_without_weight_is_a_circular_arc():
    module = CASES["A"].arm.modules[0]
    turn = 6.0 * module.cable_radius * module.length / module.bending_stiffness
    radius = module.length / turn
    base = rod_shape(CASES["A"].arm, CASES["A"].tensions)[0]
    arc = [
        radius * (1 - np.cos(turn)),
        0,
        radius * np.sin(turn),
        np.sin(turn),
        0,
        np.cos(turn),
    ]
    np.testing.assert_allclose(base, arc, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("case", rod_cases(), ids=lambda case: case.name)
def test_halving_the_grid_hardly_moves_the_modules(case):
    coarse, fine = (
        rod_shape(case.arm, case.tensions, case.tip_force, steps) for steps in (20, 40)
    )
    np.testing.assert_allclose(coarse, fine, atol=1e-6)


def test_equal_tensions_keep_a_hanging_arm_straight():
    states = rod_shape(CASES["B"].arm, np.full((3, 3), 7.0), steps_per_module=20)
    np.testing.assert_allclose(states[:, 2], [0.2, 0.4, 0.6], atol=1e-12)
    np.testing.assert_allclose(states[:, [0, 1, 3, 4]], 0, atol=1e-12)


def test_pulling_the_next_cables_instead_turns_the_arm_by_their_angle():
    arm = arm_like_case_a(modules=(module_like_case_a(),) * 3)
    tensions = np.array([[6.0, 1, 0], [2, 5, 1], [0, 0, 4]])
    positions, turned = (
        rod_shape(arm, pulls, steps_per_module=20)[:, :3]
        for pulls in (tensions, np.roll(tensions, 1, axis=1))
    )
    np.testing.assert_allclose(turned, positions @ A_THIRD_TURN.T, atol=1e-9)


def test_a_module_bends_towards_the_cable_that_pulls():
    arm = arm_like_case_a(modules=(module_like_case_a(),))
    tip = rod_shape(arm, np.array([[0, 5.0, 0]]), steps_per_module=20)[-1]
    assert np.rad2deg(np.arctan2(tip[1], tip[0])) == pytest.approx(120)


def test_a_light_tip_force_bends_two_unequal_modules_like_a_stepped_beam():
    """Castigliano: deflection = F (integral of (L - s)^2 / EI)."""
    stiff = module_like_case_a(length=0.1, bending_stiffness=0.2)
    arm = arm_like_case_a(modules=(stiff, module_like_case_a()))
    deflection = 1e-4 * ((0.3**3 - 0.2**3) / (3 * 0.2) + 0.2**3 / (3 * 0.05))
    states = rod_shape(
        arm, np.zeros((2, 3)), np.array([0, 1e-4, 0]), steps_per_module=20
    )
    np.testing.assert_allclose(states[-1, :3], [0, deflection, 0.3], atol=1e-9)


def test_the_weight_of_a_stiff_lying_module_bends_it_like_a_clamped_beam():
    """Deflection = w L^4 / (8 EI)."""
    light = module_like_case_a(mass=0.0005)
    arm = arm_like_case_a(modules=(light,), gravity_direction=(0.0, 1.0, 0.0))
    deflection = 0.0005 * 9.81 * 0.2**3 / (8 * 0.05)
    assert rod_shape(arm, np.zeros((1, 3)))[-1, 1] == pytest.approx(
        deflection, rel=1e-4
    )


@pytest.mark.parametrize(
    "tensions", [np.ones((2, 3)), np.full((3, 3), np.nan), -np.ones((3, 3))]
)
def test_impossible_tensions_are_refused(tensions):
    with pytest.raises(ActionError, match="tensions"):
        rod_shape(CASES["A"].arm, tensions)


@pytest.mark.slow
def test_a_load_beyond_what_shooting_can_follow_is_reported():
    arm = arm_like_case_a(modules=(module_like_case_a(),))
    with pytest.raises(SimulationError, match="reduce the load"):
        rod_shape(arm, np.zeros((1, 3)), np.array([0, 500.0, 0]), steps_per_module=10)


def test_a_tip_force_that_is_no_vector_is_refused():
    with pytest.raises(ActionError, match="tip_force"):
        rod_shape(CASES["A"].arm, CASES["A"].tensions, np.zeros(2))
