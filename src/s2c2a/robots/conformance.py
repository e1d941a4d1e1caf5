"""A check that anyone can run on a new body, in simulation or (gently) on hardware."""

import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.errors import ActionError, S2C2AError
from s2c2a.robots.robot import Robot
from s2c2a.spaces import Reading


def check_robot(robot: Robot) -> None:
    """Open a robot, drive it a little, and see that it keeps its promises.

    It moves every cable by at most 5 % of its range.

    Raises:
        S2C2AError: a promise is broken; the message says which.
    """
    with robot:
        geometry = ArmGeometry.of(robot.arm)
        first = robot.read()
        _check_reading(first, robot)
        _check_sends(robot, geometry)
        _check_clock(first, robot)
        _check_refuses(robot, np.full(geometry.action_neutral.shape, np.nan), "NaN")
        _check_refuses(robot, np.zeros(geometry.action_neutral.shape[0] + 1), "an action of the wrong shape")
    robot.close()


def _check_reading(reading: Reading, robot: Robot) -> None:
    modules, cables = robot.arm.module_count, robot.arm.cable_count
    _expect(reading.cables.shape == (modules, cables), f"read().cables has shape {reading.cables.shape}")
    _expect(np.isfinite(reading.cables).all(), "read().cables is not finite")
    if reading.states is not None:
        _expect(reading.states.shape == (modules, 6), f"read().states has shape {reading.states.shape}")
        lengths = np.linalg.norm(reading.states[:, 3:], axis=-1)
        _expect(np.allclose(lengths, 1.0, atol=1e-3), f"end axes have lengths {lengths}, not 1")
    if reading.configurations is not None:
        _expect(reading.configurations.shape == (modules, 3), "read().configurations is not of shape (modules, 3)")


def _check_sends(robot: Robot, geometry: ArmGeometry) -> None:
    """One gentle bend and back; what was really sent may be rounded, say to encoder ticks."""
    reach = np.abs(geometry.action_scale)[:, None]
    towards_x = geometry.action_neutral + geometry.action_scale[:, None] * 0.05 * geometry.cable_matrices[:, :, 0]
    for action in (towards_x, geometry.action_neutral):
        sent = _sent(robot, action)
        _expect(bool((np.abs(sent - action) <= 0.02 * reach).all()), "send() of an allowed action returned another one")


def _sent(robot: Robot, action: np.ndarray) -> np.ndarray:
    sent = robot.send(action)
    _expect(np.shape(sent) == action.shape, f"send() returned {sent!r}, not what was really sent, {action.shape}")
    return np.asarray(sent)


def _check_clock(first: Reading, robot: Robot) -> None:
    passed, wanted = robot.read().time - first.time, 2 * robot.arm.control_period
    _expect(abs(passed - wanted) < 0.5 * wanted, f"two control steps took {passed:.3f} s, not {wanted:.3f} s")


def _check_refuses(robot: Robot, action: np.ndarray, name: str) -> None:
    try:
        robot.send(action)
    except ActionError:
        return
    except Exception as error:
        raise S2C2AError(
            f"{type(robot).__name__}: send() of {name} raised {error!r}; it must raise ActionError"
        ) from error
    raise S2C2AError(f"{type(robot).__name__}: send() took {name}; it must raise ActionError before anything moves")


def _expect(kept: bool, fault: str) -> None:
    if not kept:
        raise S2C2AError(f"the robot breaks a promise: {fault}; see s2c2a.robots.Robot")
