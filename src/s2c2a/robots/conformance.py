"""A check that anyone can run on a new body, in simulation or (gently) on hardware."""

import time
from collections.abc import Callable, Mapping

import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.errors import ActionError, S2C2AError
from s2c2a.robots.robot import Robot
from s2c2a.spaces import POSITION, Actions, Reading

GENTLE = 0.05  # of the full bend
SETTLING = 1.0  # s


def check_robot(robot: Robot) -> list[str]:
    """Open a robot, drive it a little, and see that it keeps its promises.

    It moves every cable by at most 5 % of its range, no faster than the arm's step
    limit, and leaves the arm at rest.

    Returns:
        What was seen to be kept, in words.

    Raises:
        S2C2AError: a promise is broken; the message says which.
    """
    try:
        robot.close()  # before it was opened
        try:
            first = robot.open()
            _expect(
                isinstance(first, Reading),
                f"open() returned {first!r}, not the first reading",
            )
            geometry = ArmGeometry.of(robot.arm)
            kept = [check(robot, geometry) for check in CHECKS]
        finally:
            robot.close()
        robot.close()
    except S2C2AError:
        raise
    except Exception as error:
        raise S2C2AError(
            f"the robot breaks a promise: it raised {error!r}; see s2c2a.robots.Robot"
        ) from error
    return [*kept, "close() can be called more than once, and before open()"]


def _check_reading(robot: Robot, geometry: ArmGeometry) -> str:
    reading = robot.read()
    declared = robot.sensors
    _expect(
        isinstance(declared, Mapping) and len(declared) > 0,
        f"it declares no sensors by name: {declared!r}",
    )
    _expect(isinstance(reading, Reading), f"read() returned {reading!r}, not a Reading")
    promised = {name for name, sensor in declared.items() if sensor.always}
    missing = sorted(promised - set(reading.sensors))
    extra = sorted(set(reading.sensors) - set(declared))
    _expect(
        not missing and not extra,
        f"readings lack {missing} and hold {extra}, against what `sensors` declares",
    )
    for name, values in reading.sensors.items():
        sensor = declared[name]
        _expect(isinstance(values, np.ndarray), f"'{name}' is {values!r}, no array")
        _expect(
            values.shape == sensor.shape,
            f"'{name}' has shape {values.shape}, declared as {sensor.shape}",
        )
        known = np.isfinite(values)
        _expect(bool(known.all()) or not sensor.always, f"'{name}' is not finite")
        inside = (values >= sensor.low) & (values <= sensor.high)
        _expect(
            bool(inside[known].all()),
            f"'{name}' lies outside of its own plausible numbers",
        )
    return f"it says {', '.join(declared)}, as declared"


def _check_named(robot: Robot, geometry: ArmGeometry) -> str:
    """Sensors whose name means something say that."""
    modules, cables = geometry.action_neutral.shape
    shapes: dict[str, tuple[int, ...]] = {
        "cables": (modules, cables),
        "states": (modules, 6),
        "configurations": (modules, 3),
    }
    shapes |= {
        "tensions": (modules, cables),
        "camera_positions": (modules, 3),
        "camera_age": (),
    }
    reading = robot.read()
    for name, shape in shapes.items():
        values = reading.get(name)
        _expect(
            values is None or values.shape == shape,
            f"'{name}' is of another shape than {shape}",
        )
    for name in ("states", "configurations"):
        if (values := reading.get(name)) is not None:
            lengths = np.linalg.norm(values[:, -3:], axis=-1)
            _expect(
                bool(np.allclose(lengths, 1.0, atol=1e-3)),
                f"axes in '{name}' have lengths {lengths}, not 1",
            )
    return "names mean what they mean on every arm"


def _check_moves(robot: Robot, geometry: ArmGeometry) -> str:
    """A gentle bend towards x and back: it comes about, with the right sign, and `send` does not wait for it."""
    before = robot.read()
    towards_x = (
        geometry.action_scale[:, None] * GENTLE * geometry.cable_matrices[:, :, 0]
    )
    _lead(robot, geometry.action_neutral, geometry.action_neutral + towards_x)
    after = robot.read()
    if "cables" in robot.sensors:
        moved = (
            100
            * np.sum((after["cables"] - before["cables"]) * towards_x)
            / np.sum(towards_x**2)
        )
        _expect(
            moved > 50,
            f"'cables' went {moved:.0f} % of the way that was sent: wrong sign, or nothing moves",
        )
    if "states" in robot.sensors:
        way = after["states"][-1, POSITION] - before["states"][-1, POSITION]
        _expect(
            way[0] > 0 and way[0] > 2 * abs(way[1]),
            f"sent towards +x, the tip went {way.round(4)} m",
        )
    _lead(robot, geometry.action_neutral + towards_x, geometry.action_neutral)
    return "it moves where it is sent"


def _check_clock(robot: Robot, geometry: ArmGeometry) -> str:
    first = robot.read()
    desired = 2 * robot.arm.control_period
    _let_pass(robot, desired)
    passed = robot.read().time - first.time
    _expect(
        abs(passed - desired) < 0.5 * desired,
        f"in {desired:.3f} s, its clock went on by {passed:.3f} s",
    )
    return "its clock goes on"


def _check_prompt(robot: Robot, geometry: ArmGeometry) -> str:
    if robot.own_time:
        before = robot.read().time
        robot.send(geometry.action_neutral)
        _expect(
            robot.read().time == before,
            "time passes in send(); it must pass in advance() alone",
        )
        return "time passes in advance() alone"
    took = max(_took(lambda: robot.send(geometry.action_neutral)), _took(robot.read))
    _expect(
        took < 0.5 * robot.arm.control_period,
        f"send() or read() took {1e3 * took:.0f} ms: they must not wait",
    )
    return "send() and read() return at once"


def _check_limits(robot: Robot, geometry: ArmGeometry) -> str:
    """What is sent beyond a limit is brought within it; not tried where that would move metal."""
    sent = robot.send(geometry.action_neutral + 1e-9)
    _expect(
        np.shape(sent) == geometry.action_neutral.shape,
        f"send() returned {sent!r}, not what was really sent",
    )
    if not robot.own_time:
        return "send() returns what was really sent (limits are not tried on a real body: look at `checked_action`)"
    scale = np.abs(geometry.action_scale)[:, None]
    for beyond in (geometry.action_high + 10 * scale, geometry.action_low - 10 * scale):
        limited = np.asarray(robot.send(beyond))
        robot.send(geometry.action_neutral)
        inside = (limited >= geometry.action_low - 0.02 * scale) & (
            limited <= geometry.action_high + 0.02 * scale
        )
        _expect(bool(inside.all()), "send() of a far too large action was not limited")
    return "it keeps the arm's limits"


def _check_refuses(robot: Robot, geometry: ArmGeometry) -> str:
    shape = geometry.action_neutral.shape
    for name, action in {
        "NaN": np.full(shape, np.nan),
        "an action of the wrong shape": np.zeros(shape[0] + 1),
    }.items():
        try:
            robot.send(action)
        except ActionError:
            continue
        except Exception as error:
            _expect(
                False, f"send() of {name} raised {error!r}; it must raise ActionError"
            )
        _expect(
            False,
            f"send() took {name}; it must raise ActionError before anything moves",
        )
    return "it refuses what is no action, before anything moves"


CHECKS = (
    _check_reading,
    _check_named,
    _check_refuses,
    _check_prompt,
    _check_clock,
    _check_moves,
    _check_limits,
)


def _lead(robot: Robot, start: Actions, end: Actions) -> None:
    """From one action to another within the step limit, then a while to settle."""
    steps = int(
        np.ceil(
            GENTLE
            * np.rad2deg(ArmGeometry.of(robot.arm).action_bends.max())
            / robot.arm.step_limit_deg
        )
    )
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        action = start + share * (end - start)
        sent = np.asarray(robot.send(action))
        scale = np.abs(ArmGeometry.of(robot.arm).action_scale)[:, None]
        _expect(
            sent.shape == action.shape,
            f"send() returned {sent!r}, not what was really sent",
        )
        _expect(
            bool((np.abs(sent - action) <= 0.02 * scale).all()),
            "send() of an allowed action returned another one",
        )
        _let_pass(robot, robot.arm.control_period)
    _let_pass(robot, SETTLING)


def _let_pass(robot: Robot, seconds: float) -> None:
    if robot.own_time:
        robot.advance(seconds)
    else:
        time.sleep(seconds)


def _took(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def _expect(kept: bool, fault: str) -> None:
    if not kept:
        raise S2C2AError(f"the robot breaks a promise: {fault}; see s2c2a.robots.Robot")
