"""What must hold of any arm by symmetry, and that straight arms stand."""

import numpy as np
import pytest

from held_arm import action_for, settled
from s2c2a.arm import ArmGeometry
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot

from marks import slow_after

PRESETS = ["twin", "simulated"]


def turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    """Vectors turned about z."""
    cos, sin = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("fidelity", "closeness"), slow_after(1, [("fast", 0.003), ("accurate", 0.001)])
)
@pytest.mark.parametrize("preset", PRESETS)
def test_pulling_the_next_cables_instead_turns_the_arm_by_their_angle(
    preset, fidelity, closeness, request
):
    """Nearly by 120 or 90 deg: two hinges in series are not quite a ball joint."""
    arm = request.getfixturevalue(preset)
    action = action_for(arm, [[0.6, 0.1], [-0.3, 0.5], [0.2, -0.7]])
    here, next_ = (
        settled(arm, np.roll(action, shift, axis=1), fidelity, 10.0).states()[:, :3]
        for shift in (0, 1)
    )
    assert np.linalg.norm(here[-1, :2]) > 0.1
    np.testing.assert_allclose(
        next_, turned(here, 2 * np.pi / arm.cable_count), atol=closeness
    )


@pytest.mark.parametrize("preset", PRESETS)
def test_mirrored_actions_give_mirrored_states(preset, request):
    """Mirror in the plane of the first cable, in which the layout is symmetric."""
    arm = request.getfixturevalue(preset)
    shares = np.array([[0.6, 0.1], [-0.3, 0.5], [0.2, -0.7]])
    here, mirrored = (
        settled(arm, action_for(arm, shares * [1, side]), seconds=3.0).states()
        for side in (1, -1)
    )
    np.testing.assert_allclose(mirrored, here * [1, -1, 1, 1, -1, 1], atol=1e-6)


def pushed_aside(robot, distance: float) -> np.ndarray:
    """Push the tip aside until it stays at a distance; where it is then."""
    force, neutral = 0.0, ArmGeometry.of(robot.arm).action_neutral
    for _ in range(60):
        force += 0.02 * (1 - np.linalg.norm(robot.states()[-1, :2]) / distance)
        robot.apply_force([force, 0, 0])
        robot.step(neutral)
    return robot.states()[-1, :3]


@pytest.mark.parametrize("fidelity", slow_after(1, FIDELITIES))
@pytest.mark.parametrize("preset", PRESETS)
def test_a_straight_arm_returns_from_two_centimeters_off_axis(
    preset, fidelity, request
):
    arm = request.getfixturevalue(preset)
    with SimulatedRobot(arm, fidelity) as robot:
        rest = robot.states()[-1, :3]
        aside = pushed_aside(robot, 0.02)
        robot.apply_force([0, 0, 0])
        for _ in range(50):
            robot.step(ArmGeometry.of(arm).action_neutral)
        back = robot.states()[-1, :3]
    assert np.linalg.norm(aside - rest) == pytest.approx(0.02, abs=0.005)
    assert np.linalg.norm(back - rest) < 0.001


def test_an_arm_below_its_buckling_stiffness_does_not_return(make_arm):
    """An upright column of 0.6 m and 0.225 kg buckles below about EI = 0.1 N m2."""
    arm = make_arm(
        actuation="tension", module={"tension_range": 1.0, "bending_stiffness": 0.03}
    )
    with SimulatedRobot(arm) as robot:
        robot.apply_force([0.05, 0, 0])
        for step in range(80):
            robot.apply_force([0.05 * (step < 20), 0, 0])
            robot.step(np.zeros((3, 3)))
        assert np.linalg.norm(robot.states()[-1, :2]) > 0.1


@pytest.mark.parametrize("direction", [[1, 0, 0], [0, -1, 0], [0.6, 0.8, 0]])
@pytest.mark.parametrize(("preset", "aligned"), [("twin", 0.9), ("simulated", 0.999)])
def test_a_force_at_the_tip_moves_it_along_the_force(
    preset, aligned, direction, request
):
    """Only taut cables resist, so the tip also moves a little towards slack ones."""
    arm = request.getfixturevalue(preset)
    with SimulatedRobot(arm) as robot:
        robot.apply_force(0.05 * np.array(direction))
        for _ in range(20):
            robot.step(ArmGeometry.of(arm).action_neutral)
        moved = robot.states()[-1, :3] - [0, 0, arm.length]
    assert moved @ direction > max(0.003, aligned * np.linalg.norm(moved))
