"""The center-line sensor: its values, and that it does not change the simulation."""

from itertools import pairwise

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.kinematics import center_line
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot

STEPS = 4


def driven(arm, fidelity, center_line):
    """Readings of a robot that is driven at random from rest."""
    geometry, random = ArmGeometry.of(arm), np.random.default_rng(0)
    robot = SimulatedRobot(arm, fidelity, center_line=center_line)
    readings = [robot.open()]
    for _ in range(STEPS):
        robot.step(random.uniform(geometry.action_low, geometry.action_high))
        readings.append(robot.read())
    return robot, readings


@pytest.fixture(
    scope="module",
    params=[
        (arm, fidelity) for arm in ("twin", "simulated") for fidelity in FIDELITIES
    ],
)
def both(request):
    """A robot with and one without the sensor after the same actions, and their readings."""
    arm = request.getfixturevalue(request.param[0])
    return driven(arm, request.param[1], center_line=True), driven(
        arm, request.param[1], center_line=False
    )


def test_recording_the_center_line_changes_nothing(both):
    """The first robot has sensors, the other has none."""
    (_, watched), (_, unwatched) = both
    for one, other in zip(watched, unwatched, strict=True):
        np.testing.assert_array_equal(one["states"], other["states"])


def test_the_center_line_has_five_points_a_module_at_every_physics_step(both):
    """At the start of every physics step, and at the end of the last."""
    (robot, readings), _ = both
    moments = round(0.1 / robot.model.opt.timestep) + 1
    assert [reading["center_line"].shape for reading in readings] == [
        (moments, 15, 3)
    ] * (STEPS + 1)


def test_the_newest_sample_ends_at_the_module_ends_of_the_states(both):
    (_, readings), _ = both
    for reading in readings:
        newest = reading["center_line"][-1]
        np.testing.assert_array_equal(newest[-1], reading["states"][-1, :3])
        np.testing.assert_allclose(newest[4::5], reading["states"][:, :3], atol=1e-12)


def test_the_oldest_sample_is_the_newest_of_the_previous_reading(both):
    (_, readings), _ = both
    for before, after in pairwise(readings):
        np.testing.assert_allclose(
            after["center_line"][0], before["center_line"][-1], atol=1e-12
        )


def test_points_come_from_base_to_tip_a_fifth_of_a_module_apart(both):
    (_, readings), _ = both
    for reading in readings:
        line = np.concatenate(
            [np.zeros((len(reading["center_line"]), 1, 3)), reading["center_line"]],
            axis=1,
        )
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(line, axis=1), axis=-1), 0.04, rtol=0.02
        )


def test_the_center_line_from_states_is_near_the_recorded_one(both):
    """Two ways to the same line, on arms in motion."""
    (robot, readings), _ = both
    lengths = ArmGeometry.of(robot.arm).lengths.astype(np.float32)
    for reading in readings:
        guessed = center_line(reading["states"].astype(np.float32), lengths)
        np.testing.assert_allclose(guessed, reading["center_line"][-1], atol=0.005)
