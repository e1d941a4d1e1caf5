"""Checked actions: clipped to the limits, rejected if invalid."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.errors import ActionError
from s2c2a.robots import checked_action
from s2c2a.robots.simulation import SimulatedRobot


def test_an_action_within_the_limits_stays_as_it_is(twin):
    geometry = ArmGeometry.of(twin)
    action = 0.5 * geometry.action_high * np.array([1, -1, 0.3])
    np.testing.assert_array_equal(checked_action(action.tolist(), geometry), action)


def test_each_cable_is_clipped_to_its_own_limits(simulated):
    geometry = ArmGeometry.of(simulated)
    action = geometry.action_neutral.copy()
    action[0, 1], action[2, 3] = 1e6, -1e6
    expected = geometry.action_neutral.copy()
    expected[0, 1] = geometry.action_high[0, 1]
    expected[2, 3] = geometry.action_low[2, 3]
    np.testing.assert_array_equal(checked_action(action, geometry), expected)


def test_a_tension_is_never_negative(simulated):
    assert checked_action(np.full((3, 4), -5.0), ArmGeometry.of(simulated)).min() >= 0


@pytest.mark.parametrize("preset", ["twin", "simulated"])
def test_send_returns_what_was_clipped(preset, request):
    arm = request.getfixturevalue(preset)
    geometry = ArmGeometry.of(arm)
    with SimulatedRobot(arm) as robot:
        np.testing.assert_array_equal(
            robot.send(np.full_like(geometry.action_low, 1e3)), geometry.action_high
        )
        np.testing.assert_array_equal(
            robot.send(np.full_like(geometry.action_low, -1e3)), geometry.action_low
        )


REFUSED = {
    "NaN": np.full((3, 3), np.nan),
    "one infinite cable": np.diag([0, 0, np.inf]),
    "too few modules": np.zeros((2, 3)),
    "flat": np.zeros(9),
    "a batch": np.zeros((1, 3, 3)),
    "empty": [],
    "nothing": None,
    "ragged": [[0.0, 0.0, 0.0], [0.0]],
    "words": [["a", "b", "c"]] * 3,
}


@pytest.mark.parametrize("action", REFUSED.values(), ids=REFUSED)
def test_an_invalid_action_is_rejected_and_nothing_moves(action, twin):
    robot = SimulatedRobot(twin)
    robot.open()
    robot.step(np.array([[-0.01, 0.005, 0.005]] * 3))

    def state():
        data = robot.data
        return np.concatenate([[data.time], data.qpos, data.qvel, data.ctrl])

    before = state()
    with pytest.raises(ActionError):
        robot.send(action)
    np.testing.assert_array_equal(state(), before)


def test_a_rejected_action_has_no_later_effect(twin):
    action = np.array([[-0.01, 0.005, 0.005]] * 3)
    tips = []
    for refused in (action[:, :2], None):
        with SimulatedRobot(twin) as robot:
            with pytest.raises(ActionError):
                robot.send(refused)
            robot.step(action)
            tips.append(robot.read()["states"])
    np.testing.assert_array_equal(*tips)


def test_the_message_names_the_given_and_the_expected_shape(twin):
    with pytest.raises(ActionError, match=r"\(2, 3\).*\(3, 3\)"):
        SimulatedRobot(twin).send(np.zeros((2, 3)))
