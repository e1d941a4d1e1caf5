"""Teleoperation of an arm: a device moves the target, the control follows it."""

import math
import time
from collections.abc import Callable

from s2c2a.emergency import EMERGENCY_STOP
from s2c2a.integrations.teleoperation.demonstrations import Demonstrations
from s2c2a.integrations.teleoperation.device import (
    Button,
    DeviceInput,
    TeleoperationDevice,
    read_input,
)
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.live.steering import moved_target
from s2c2a.spaces import Stage

PERIOD = 1 / 50  # s between readings of the device
STATUS_PERIOD = 0.2  # s between status lines
STANDING_STAGES = (Stage.RELEASE, Stage.FAULT)
"""Stages in which the target does not move: the arm would not follow."""


class Teleoperation:
    """Moves the target of a running control as a device says.

    The arm starts from rest with the first motion, and the target from the tip.
    Without motion the target, and so the arm, stays where it is.

    Attributes:
        message: the last event, such as a saved demonstration.
        ended: whether the device asked to quit.
    """

    def __init__(
        self,
        control: Control,
        device: TeleoperationDevice,
        demonstrations: Demonstrations | None = None,
    ):
        """Begin at rest.

        Args:
            control: that is started.
            device: that is opened.
            demonstrations: where motions are recorded; nothing is recorded if None.
        """
        self._control = control
        self._device = device
        self._demonstrations = demonstrations
        self.message = ""
        self.ended = False

    def step(self, seconds: float) -> None:
        """Read the device once and obey it.

        Args:
            seconds: since the last step.

        Raises:
            S2C2AError: the device is lost or gives something else than an input, or a
                demonstration cannot be written.
        """
        given = read_input(self._device)
        for button in given.pressed:
            self._press(button)
        self._move(given, seconds)
        if self._demonstrations is not None and self._demonstrations.full:
            self._toggle_recording(self._demonstrations)

    def run(
        self,
        show: Callable[[str], None] = lambda line: None,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Obey the device until it asks to quit.

        Args:
            show: called with the status line.
            now: clock [s].
            sleep: waits [s].
        """
        last = now()
        shown = -math.inf
        while not self.ended:
            moment = now()
            self.step(moment - last)
            last = moment
            if moment - shown > STATUS_PERIOD:
                show(self.status())
                shown = moment
            sleep(PERIOD)

    def status(self) -> str:
        """One line: stage, target, tip, error, demonstrations, and the last event."""
        latest = self._control.latest
        if latest is None:
            return "the arm is not ready"
        parts = [_stage_text(self._control, latest)]
        target = self._control.request.target
        if target is not None and latest.stage in (Stage.RUN, Stage.HOLD):
            parts.append(f"target {_centimeters(target)}")
        parts.append(f"tip {_centimeters(latest.tip)} cm")
        if math.isfinite(latest.error):
            parts.append(f"error {100 * latest.error:.1f} cm")
        if self._demonstrations is not None:
            parts.append(_recording_text(self._demonstrations))
        return " · ".join([*parts, *[self.message] * bool(self.message)])

    def _move(self, given: DeviceInput, seconds: float) -> None:
        """Move the target; the first motion starts the arm."""
        control = self._control
        latest = control.latest
        if latest is None or not any(given.velocity):
            return
        if control.request.stopped or latest.stage in STANDING_STAGES:
            return
        request = control.request
        if not request.driven or request.target is None:
            request = control.ask(driven=True, target=latest.tip)
        if request.target is not None:
            arm = control.arm
            target = moved_target(request.target, given.velocity, seconds, arm)
            control.ask(target=target)

    def _press(self, button: Button) -> None:
        control = self._control
        match button:
            case Button.STOP:
                EMERGENCY_STOP.trigger("the operator")
                self.message = "emergency stop"
            case Button.RESUME:
                self._resume()
            case Button.REST:
                control.ask(driven=False)
                self.message = "the arm returns to rest"
            case Button.QUIT:
                self.ended = True
            case Button.RECORD if self._demonstrations is not None:
                self._toggle_recording(self._demonstrations)
            case Button.DISCARD if self._demonstrations is not None:
                self._demonstrations.discard()
                self.message = "discarded"
            case _:
                self.message = "nothing is recorded without --out"

    def _resume(self) -> None:
        """Allow motion after a stop; after a fault, the robot is opened again."""
        control = self._control
        self.message = ""
        if control.latest is not None and control.latest.stage is Stage.FAULT:
            control.ask(driven=False, stopped=False)
            control.reset()
        else:
            control.ask(stopped=False)

    def _toggle_recording(self, demonstrations: Demonstrations) -> None:
        if not demonstrations.running:
            demonstrations.start()
            self.message = ""
        elif demonstrations.save():
            self.message = f"saved demonstration {demonstrations.count}"
        else:
            self.message = "not saved: the arm did not move"


def _stage_text(control: Control, latest: Snapshot) -> str:
    """What the arm does, and why it does not move."""
    if latest.fault:
        return f"{latest.stage}: {latest.fault}"
    if control.request.stopped:
        return f"stopped: {control.halted_by}"
    return str(latest.stage)


def _recording_text(demonstrations: Demonstrations) -> str:
    saved = f"{demonstrations.count} saved"
    if demonstrations.running:
        return f"RECORDING {demonstrations.seconds:.0f} s, {saved}"
    return saved


def _centimeters(place: tuple[float, float, float]) -> str:
    """A point [m] in cm."""
    return ", ".join(f"{100 * coordinate:.1f}" for coordinate in place)
