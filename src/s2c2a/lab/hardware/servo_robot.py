"""A real arm whose cables are wound by bus servos."""

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from typing import ClassVar

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec, servos_of
from s2c2a.errors import RobotError, S2C2AError
from s2c2a.lab.hardware.bus import (
    NO_CURRENT,
    NO_WATCHDOG,
    BusError,
    PortLostError,
    ServoBus,
    ServoStates,
)
from s2c2a.lab.hardware.buses import open_bus
from s2c2a.lab.hardware.calibration import default_path, load_calibration
from s2c2a.lab.hardware.monitor import CableMonitor, describe_faults
from s2c2a.lab.hardware.motion_watch import MotionWatch
from s2c2a.lab.hardware.presence import check_presence
from s2c2a.lab.hardware.winch import (
    MARGIN,
    NO_SERVO,
    Cables,
    Winches,
    check_plausible,
    check_ticks,
    servo_ids,
    servo_values,
    taut_windings,
    torque_constants,
)
from s2c2a.robots.robot import Robot, checked_action
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.runtime.limits import command_range
from s2c2a.spaces import Actions, Reading, Sensor

READ_SHARE = 0.25  # of a control period, in which servos are asked again
PATIENCE = 1.0  # s for an answer while the arm is at rest
REST_SPEED = 0.25  # of the largest speed, on the way to rest at the start
REST_PERIOD = 0.02  # s between goals on that way
APPROACH_MARGIN = 15.0  # s beyond its duration, for servos that must be asked again
SETTLING_TIME = 1.0  # s
MANY_TURNS = (
    "the cables wind more than a turn of their pulleys, and servos forget whole turns "
    "without power: home the arm again after every loss of power"
)
NOISE_TICKS = 20
RATE_FACTOR = 6.0  # largest plausible speed of a cable over that of commands


class ServoRobot(Robot):
    """An arm with one servo and one pulley for each cable.

    Use a subclass that names a protocol. The table `[servos.limits]` of the arm file
    defines the limits: `send` limits displacement and speed, the servos limit their
    current, and a reading has a fault if a temperature or voltage is out of limits or a
    servo stalls, so that the control loop holds the arm and moves it to rest.

    Args:
        arm: description of the arm.
        port: serial port; empty: `servos.port` of the arm file.
        calibration: file of `s2c2a motors home`; empty: the default name, in the
            current folder.
        fast_read: whether all servos answer in one packet.
    """

    own_time = False
    protocol: ClassVar[str]

    def __init__(
        self,
        arm: ArmSpec,
        port: str = "",
        calibration: str = "",
        fast_read: bool = False,
    ):
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._servos = servos_of(arm)
        if self._servos.protocol != self.protocol:
            raise S2C2AError(
                f"the servos of '{self.arm.name}' speak {self._servos.protocol}, not "
                f"{self.protocol}; choose --robot {self._servos.protocol}, or correct "
                "servos.protocol in the arm file"
            )
        path = calibration or default_path(arm)
        self._calibration = load_calibration(path, arm)
        self._winches = Winches.of(arm, self._calibration.home(arm))
        self._port = port
        self._fast_read = fast_read
        self._ids = servo_ids(arm)
        self._speeds = servo_values(arm, lambda servos: servos.limits.speed)
        self._present = self._ids != NO_SERVO
        self._bus: ServoBus | None = None
        self._is_halted = False
        self._low, self._high = command_range(arm)
        self._goal = self._geometry.action_neutral
        self._has_warned = False
        self._monitor = CableMonitor(
            self._servos, arm.control_rate, arm.motor.current_friction
        )
        self._opened_at = 0.0
        self._budget = np.zeros(self._ids.shape)
        self._sent_at = 0.0

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        """Cable displacements [m] and, if the arm file has them, tensions [N]."""
        sensors = {"cables": self._declare_cables()}
        if self.arm.motor.current_noise is not None:
            sensors["tensions"] = Sensor(self._ids.shape, "N")
        return sensors

    def open(self) -> Reading:
        """Connect, check every servo, and wind slowly to rest; see `Robot`.

        Servos are prepared again after a fault or a halt, with their torque off.

        Raises:
            BusError: the port or a servo is missing.
            RobotError: a servo is not the calibrated one or has a fault, or a cable is
                out of its range.
            EmergencyStopError: the emergency stop was triggered; the arm is halted.
        """
        EMERGENCY_STOP.check()
        if not self._is_ready():
            self._disconnect()
            self._connect()
        try:
            self._go_to_rest()
        except EmergencyStopError:
            self.halt()
            raise
        self._monitor.reset()
        self._has_warned = False
        self._opened_at = time.perf_counter()
        return self.read()

    def read(self) -> Reading:
        """Return displacements [m] and tensions [N], shape (modules, cables).

        Missing measurements are NaN. A lost port is a fault of the reading.
        """
        moment = time.perf_counter() - self._opened_at
        try:
            states = self._read_states()
        except PortLostError as error:
            return self._lost_reading(moment, str(error))
        displacements = self._winches.displacements(self._values(states, "position"))
        currents = self._values(states, "current")
        tensions = self._winches.tensions(currents, self._torque_constants)
        values = {"cables": displacements}
        if self.arm.motor.current_noise is not None:
            values["tensions"] = tensions
        fault = self._describe_faults(states)
        fault = fault or self._monitor.find_fault(self._goal, displacements)
        # warn of a cable that may have snapped, once after every opening
        text = self._monitor.find_slack(displacements, tensions)
        if text and not self._has_warned:
            self._has_warned = True
            warnings.warn(text, stacklevel=1)
        self._restart_after_watchdog(states)
        return Reading(moment, values, fault)

    def send(self, action: Actions) -> Actions:
        """Send displacements within the limits of value and speed; see `Robot`."""
        wanted = checked_action(action, self._geometry)
        limited = self._limited(np.clip(wanted, self._low, self._high))
        positions = self._winches.positions(limited)
        self._send_positions(positions)
        sent = self._winches.displacements(positions)
        # of what is sent, in whole ticks, so that rounding does not add up
        self._budget -= np.abs(sent - self._goal)
        self._goal = sent
        return self._goal.copy()

    def halt(self) -> None:
        """Stop every servo where it is, then hold or release; see `Robot`."""
        if self._bus is None:
            return
        self._is_halted = True
        try:
            patience = READ_SHARE * self.arm.control_period
            self.bus.stop(self._flat_ids, patience)
        finally:
            if self._servos.on_emergency == "release":
                with suppress(BusError):
                    self.bus.set_torque(self._flat_ids, on=False)

    def close(self) -> None:
        """Hold or release the cables as configured, and close the port.

        After a halt, `on_emergency` decides instead of `on_exit`.
        """
        servos = self._servos
        choice = servos.on_emergency if self._is_halted else servos.on_exit
        self._disconnect(choice == "release")

    @property
    def bus(self) -> ServoBus:
        """The open bus.

        Raises:
            RobotError: the robot is not open.
        """
        if self._bus is None:
            raise RobotError(
                f"{type(self).__name__} is not open; call open() before it moves"
            )
        return self._bus

    @property
    def _torque_constants(self) -> Cables:
        """Of the servos [N m/A]."""
        return torque_constants(self.arm, self.bus)

    @property
    def _flat_ids(self) -> list[int]:
        return self._ids[self._present].tolist()

    def _is_ready(self) -> bool:
        """Whether all servos are prepared and sound."""
        if self._bus is None or self._is_halted:
            return False
        try:
            return not self._describe_faults(self._read_states())
        except PortLostError:
            return False

    def _disconnect(self, release: bool = False) -> None:
        """Close the port; servos that keep torque stop by their watchdogs and hold."""
        bus, self._bus = self._bus, None
        if bus is None:
            return
        with bus, suppress(BusError):
            if release:
                bus.set_torque(self._flat_ids, on=False)

    def _connect(self) -> None:
        bus = open_bus(self._servos, self._port, self._fast_read)
        try:
            check_ticks(self.arm, bus)
            # check that every servo answers and is the calibrated one
            check_presence(bus, self._flat_ids, self._servos.number_of)
            found = {info.id: info for info in bus.scan(self._flat_ids)}
            for servo in self._calibration.servos:
                info = found.get(servo.id)
                if info and (info.model, info.firmware) != (
                    servo.model,
                    servo.firmware,
                ):
                    raise RobotError(
                        f"servo {info.id} is {info.model} with firmware {info.firmware}; "
                        f"{servo.model} with firmware {servo.firmware} was calibrated. If "
                        "you replaced it, home the arm again (`s2c2a motors home`)"
                    )
            for part, ids in self._servos.parts():
                speed = part.limits.speed / self.arm.motor.pulley_radius
                bus.prepare(ids, part.limits.current, speed)
        except BaseException:
            bus.close()
            raise
        if not bus.has_watchdog:
            warnings.warn(NO_WATCHDOG, stacklevel=1)
        if not bus.has_current:
            warnings.warn(NO_CURRENT, stacklevel=1)
        self._bus = bus
        self._is_halted = False
        try:
            # let the servos hold the arm where it is
            states = self._read_all()
            fault = self._describe_faults(states)
            if fault:
                raise RobotError(f"the arm cannot start: {fault}")
            positions = self._positions(states)
            turn = 2 * np.pi * self.arm.motor.pulley_radius
            if (self._high - self._low).max() >= turn:
                warnings.warn(MANY_TURNS, stacklevel=1)
            self._winches = self._winches.in_same_turn(positions)
            displacements = self._winches.displacements(positions)
            check_plausible(displacements, self.arm)
            self._goal = displacements
            self._send_positions(positions)
            self.bus.set_torque(self._flat_ids, on=True)
        except BaseException:
            self.close()
            raise

    def last_calibration(self) -> datetime:
        """When the arm was homed."""
        return self._calibration.date

    def _go_to_rest(self) -> None:
        """Wind all cables to rest together, slowly, and let the arm settle.

        The cables become as taut as in homing and return: their backlash is then taken
        up, whatever the arm did before. Cables that come from slack would stay loose.
        """
        start = self._winches.displacements(self._positions(self._read_all()))
        rest = self._geometry.action_neutral
        windings = taut_windings(self.arm, self._torque_constants)
        taut = np.maximum(rest - windings, self._low)
        self._approach(start, taut)
        self._approach(taut, rest)
        self._wind_along([rest] * round(SETTLING_TIME / REST_PERIOD))

    def _approach(self, start: Actions, target: Actions) -> None:
        """Wind all cables together, slowly and smoothly; see `_wind_along`."""
        # time [s] for a distance [m], within the limits of rate and acceleration
        distance = float(np.abs(start - target).max())
        geometry = self._geometry
        period = self.arm.control_period
        radius = float(geometry.cable_radii[self._present.any(axis=-1)].min())
        bending_speed = radius * geometry.step_limit / period
        speed = min(REST_SPEED * self._speeds[self._present].min(), bending_speed)
        acceleration = radius * geometry.acceleration_limit / period**2
        # the slope of the shares below is at most 1.5, their curvature 6
        duration = max(1.5 * distance / speed, math.sqrt(6.0 * distance / acceleration))
        count = int(np.ceil(duration / REST_PERIOD))
        parts = np.linspace(0.0, 1.0, count + 1)[1:]
        shares = parts**2 * (3.0 - 2.0 * parts)  # starts and ends at rest
        self._wind_along([start + share * (target - start) for share in shares])

    def _wind_along(self, path: Sequence[Actions]) -> None:
        """Send displacements on the way to rest, one every `REST_PERIOD`.

        Raises:
            RobotError: a servo is at fault, or it takes longer by `APPROACH_MARGIN` than
                planned.
            EmergencyStopError: the arm must not move.
        """
        overdue = RobotError(
            "the arm stopped on its way to rest: the servos answer too slowly; "
            "check the bus (`s2c2a motors timing`)"
        )
        watch = MotionWatch(len(path) * REST_PERIOD + APPROACH_MARGIN, overdue)
        for displacements in path:
            watch.check()
            positions = self._winches.positions(displacements)
            self._send_positions(positions)
            self._goal = self._winches.displacements(positions)
            fault = self._describe_faults(self._read_all())
            if fault:
                raise RobotError(f"the arm stopped on its way to rest: {fault}")
            time.sleep(REST_PERIOD)

    def _read_states(self) -> ServoStates:
        """Read all servos; those that do not answer are asked again at once."""
        patience = READ_SHARE * self.arm.control_period
        return self.bus.read_patiently(self._flat_ids, patience)

    def _read_all(self) -> ServoStates:
        """Read all servos; those that stopped by their watchdog obey again.

        Raises:
            BusError: a servo does not answer.
        """
        states = self.bus.read_patiently(self._flat_ids, PATIENCE)
        if any(state.watchdog_tripped for state in states.values()):
            self._restart_after_watchdog(states)
            states |= self.bus.read_patiently(self._flat_ids, PATIENCE)
        if len(states) < len(self._flat_ids):
            raise BusError(self._describe_faults(states))
        return states

    def _describe_faults(self, states: ServoStates) -> str:
        """Describe the first fault of the servos; empty if there is none."""
        restarted = self.bus.restarted
        return describe_faults(states, self._servos, self._flat_ids, restarted)

    def _values(self, states: ServoStates, name: str) -> np.ndarray:
        """A measurement of all servos; NaN where one did not answer, zero without one."""
        values = [
            getattr(states[id], name) if id in states else np.nan
            for id in self._flat_ids
        ]
        rows = np.zeros(self._ids.shape)
        rows[self._present] = values
        return rows

    def _positions(self, states: ServoStates) -> np.ndarray:
        return self._values(states, "position").astype(int)

    def _lost_reading(self, moment: float, fault: str) -> Reading:
        """A reading without any measurement."""
        shapes = {name: sensor.shape for name, sensor in self.sensors.items()}
        missing = {name: np.full(shape, np.nan) for name, shape in shapes.items()}
        return Reading(moment, missing, fault)

    def _send_positions(self, positions: np.ndarray) -> None:
        goals = zip(self._flat_ids, positions[self._present].tolist(), strict=True)
        self.bus.send_goals(dict(goals))
        self._sent_at = time.perf_counter()

    def _limited(self, wanted: Actions) -> Actions:
        """Limit the change since the last command by the largest speed.

        Commands that come late do not make up for the time that was lost.
        """
        elapsed = time.perf_counter() - self._sent_at
        speed = self._speeds
        most = 2.0 * speed * self.arm.control_period
        self._budget = np.minimum(self._budget + speed * elapsed, most)
        reach = np.maximum(self._budget, 0.0)
        return self._goal + np.clip(wanted - self._goal, -reach, reach)

    def _restart_after_watchdog(self, states: ServoStates) -> None:
        """Let servos that stopped by their watchdog go to the last goal and obey."""
        stopped = [id for id, state in states.items() if state.watchdog_tripped]
        if not stopped:
            return
        # where it fails, the next reading shows it again
        with suppress(BusError):
            for id in stopped:
                # one after the other, so that no servo is without a watchdog for long
                self.bus.arm_watchdog([id], 0.0)
                self.bus.arm_watchdog([id], self._servos.watchdog)
            self._send_positions(self._winches.positions(self._goal))

    def _declare_cables(self) -> Sensor:
        """Displacements beyond the limits by a part of the range are plausible."""
        noise = NOISE_TICKS * 2 * np.pi * self.arm.motor.pulley_radius
        noise = noise / self.arm.motor.ticks_per_turn
        room = MARGIN * (self._high - self._low) + noise
        scale = np.abs(self._geometry.action_scale)[:, None]
        bends = self._geometry.action_bends[:, None]
        rate = np.deg2rad(self.arm.step_limit_deg) * self.arm.control_rate
        fastest = RATE_FACTOR * scale / bends * rate + noise * self.arm.control_rate
        return Sensor(
            self._ids.shape, "m", self._low - room, self._high + room, fastest
        )


class DynamixelRobot(ServoRobot):
    """An arm with DYNAMIXEL servos."""

    protocol = "dynamixel"


class FeetechRobot(ServoRobot):
    """An arm with Feetech servos."""

    protocol = "feetech"
