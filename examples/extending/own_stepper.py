r"""A winch of stepper motors on an Arduino, with `stepper_winch/stepper_winch.ino`.

    s2c2a robot check --robot own_stepper.py:StepperWinch --arm planar_finger \
        --robot-option port=/dev/ttyACM0 home=1

Readings are the steps that the board has counted, not measurements: a motor that
loses steps goes unnoticed. `home=1` states that the arm is straight now, by hand.
"""

import time
from contextlib import suppress

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import cables_present
from s2c2a.errors import RobotError
from s2c2a.lab.hardware.bus import PortLostError
from s2c2a.lab.hardware.serial_line import SerialLine
from s2c2a.robots import Robot, checked_action
from s2c2a.runtime.emergency import EMERGENCY_STOP
from s2c2a.spaces import Reading, Sensor

BOOT_TIME = 4.0  # s; many boards restart when their port opens
READ_SHARE = 0.4  # of a control period, for an answer; reading may take half of it
REST_SHARE = 0.25  # of the arm's largest speed, on the way to rest at the start
REST_PERIOD = 0.02  # s


class StepperWinch(Robot):
    """One stepper motor for each cable; positive steps pay out."""

    def __init__(
        self, arm: ArmSpec, port: str, steps_per_turn: int = 1600, home: bool = False
    ):
        if arm.actuation != "displacement":
            raise RobotError(
                f"a stepper winch commands displacements; '{arm.name}' has "
                f'actuation = "{arm.actuation}": choose an arm with "displacement"'
            )
        if steps_per_turn < 1:
            raise RobotError(
                f"steps_per_turn is {steps_per_turn}; give the steps of one turn of the "
                "pulley with the microsteps of the driver, such as 1600"
            )
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._present = cables_present(arm)
        self._step = 2 * np.pi * arm.motor.pulley_radius / steps_per_turn  # [m]
        self._port = port
        self._home = home
        self._line: SerialLine | None = None
        self._begun = 0.0

    @property
    def sensors(self):
        margin = 0.1 * np.abs(self._geometry.action_scale)[:, None]
        low = self._geometry.action_low - margin
        high = self._geometry.action_high + margin
        return {"cables": Sensor(low.shape, "m", low, high)}

    def open(self) -> Reading:
        EMERGENCY_STOP.check()
        if self._line is None:
            self._line = SerialLine(self._port, 115_200)
            self._wait_for_board()
        if self._home:
            self._home = False  # a later opening may find the arm bent
            self._exchange("H")
        self._go_to_rest()
        self._begun = time.perf_counter()
        return self.read()

    def read(self) -> Reading:
        moment = time.perf_counter() - self._begun
        cables = np.full(self._present.shape, np.nan)
        fault = ""
        try:
            cables = self._cables(READ_SHARE * self.arm.control_period)
        except RobotError as error:
            fault = str(error)
        return Reading(moment, {"cables": cables}, fault)

    def send(self, action):
        steps = np.rint(checked_action(action, self._geometry) / self._step)
        numbers = steps[self._present].astype(int).tolist()
        self._exchange(" ".join(map(str, ["M", *numbers, sum(numbers)])))
        return self._step * steps

    def halt(self) -> None:
        if self._line is not None:
            self._exchange("S")

    def close(self) -> None:
        """The motors brake and hold; without a port, they do so by themselves."""
        with suppress(PortLostError):
            self.halt()
        if self._line is not None:
            self._line.close()
            self._line = None

    def _wait_for_board(self) -> None:
        end = time.monotonic() + BOOT_TIME
        while not self._exchange("?", 0.5):
            if time.monotonic() > end:
                raise RobotError(
                    f"nothing answered at {self._port} for {BOOT_TIME:.0f} s: check the "
                    "port, and that the sketch stepper_winch is on the board"
                )

    def _go_to_rest(self) -> None:
        """Return slowly from where the cables are, and let the arm settle."""
        start = self._cables(0.5)
        radius = self._geometry.cable_radii[self._present.any(axis=-1)].min()
        speed = radius * self._geometry.step_limit / self.arm.control_period
        most = REST_SHARE * speed * REST_PERIOD
        count = int(np.ceil(np.abs(start).max() / most))
        settling = round(1.0 / REST_PERIOD)
        for share in [*np.linspace(1.0, 0.0, count + 1), *[0.0] * settling]:
            EMERGENCY_STOP.check()
            self.send(share * start)
            time.sleep(REST_PERIOD)

    def _cables(self, patience: float):
        """Ask for the displacements [m], shape (modules, cables)."""
        steps = steps_of(self._exchange("?", patience))
        count = self._present.sum()
        if len(steps) != count:
            raise RobotError(
                f"the winch has {len(steps)} motors and '{self.arm.name}' {count} "
                "cables: correct MOTORS in the sketch, or choose another arm file"
            )
        cables = np.zeros(self._present.shape)
        cables[self._present] = self._step * np.array(steps, float)
        return cables

    def _exchange(self, text: str, patience: float = 0.0) -> str:
        """Send a line; return the last line of the answer, empty if none comes."""
        if self._line is None:
            raise RobotError("StepperWinch is not open; call open() before it moves")
        try:
            self._line.write(f"{text}\n".encode())
            heard = b""
            deadline = time.monotonic() + patience
            while not heard.endswith(b"\n") and time.monotonic() < deadline:
                heard = (heard + self._line.read(deadline))[-1000:]
        except PortLostError:
            self._line.close()
            self._line = None
            raise
        # an answer that is not complete is none
        is_complete = heard.endswith(b"\n")
        return heard.decode("ascii", "replace").splitlines()[-1] if is_complete else ""


def steps_of(answer: str) -> list[int]:
    """The positions in an answer such as "P 120 -40 80"; the last number is their sum."""
    if answer == "U":
        raise RobotError(
            "the winch has just started and does not know where it is: straighten the "
            "arm by hand, then repeat the command with --robot-option home=1"
        )
    kind, *words = answer.split() or [""]
    with suppress(ValueError):
        *steps, total = map(int, words)
        if kind == "P" and sum(steps) == total:
            return steps
    if not answer:
        raise RobotError("the winch does not answer: check its cable and its supply")
    raise RobotError(f"the winch gave a damaged answer: {answer[:80]!r}")
