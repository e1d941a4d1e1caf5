"""Faults of servos and cables, in words."""

from collections.abc import Container, Iterable

import numpy as np

from s2c2a.arm import Servos
from s2c2a.lab.hardware.bus import RESTARTED, ServoState, ServoStates
from s2c2a.lab.hardware.presence import ALL_SILENT
from s2c2a.spaces import Actions

SLACK = 0.5  # N; a cable without load shows less, with the noise of the current
WOUND_IN = 0.006  # m; a module with such a cable is bent by tension
SNAP_TIME = 2.0  # s; a vibrating arm has slack cables for up to 1.1 s
GEAR_FRICTION = 0.4  # N of cable tension; of the XL330, if the arm file has none
MOVING = 0.0001  # m between two readings
FOLLOWING_ERROR = 0.004  # m
STALL_TIME = 1.0  # s


def describe_faults(
    states: ServoStates,
    servos: Servos,
    ids: Iterable[int],
    restarted: Container[int],
) -> str:
    """Describe the first fault of an arm's servos; empty if there is none.

    Args:
        states: by id; a servo that did not answer is missing.
        servos: of the arm, with their limits.
        ids: servos that were read.
        restarted: servos that lost their settings.
    """
    ids = tuple(ids)
    if len(ids) > 1 and not states and not any(id in restarted for id in ids):
        return f"none of the {len(ids)} servos answers; {ALL_SILENT}"
    for id in ids:
        fault = RESTARTED
        if id not in restarted:
            fault = _servo_fault(states.get(id), servos.of(id))
        if fault:
            return f"servo {id} ({servos.number_of(id)}) {fault}"
    return ""


def _servo_fault(state: ServoState | None, servos: Servos) -> str:
    limits = servos.limits
    if state is None:
        return "does not answer"
    if state.errors:
        names = ", ".join(sorted(error.value for error in state.errors))
        return (
            f"has switched off: {names}; remove the cause, then `s2c2a motors reboot`"
        )
    if state.watchdog_tripped:
        return f"stopped by itself: no command for {servos.watchdog:g} s"
    if state.temperature > limits.temperature:
        return f"has {state.temperature:.0f} deg C; the limit is {limits.temperature:g}"
    if not limits.low_voltage <= state.voltage <= limits.high_voltage:
        return (
            f"is supplied with {state.voltage:.1f} V; allowed are "
            f"{limits.low_voltage:g} to {limits.high_voltage:g}"
        )
    return ""


class CableMonitor:
    """Finds servos that stall, and cables that may have snapped.

    A module is bent by the cables that are wound in. If they carry nothing because the
    module leans on their side, under its weight or a payload, then the others hold it.
    If no cable carries a load, then the one that is wound in may have snapped. It may
    also be a module whose stiffness balances its load without any cable, so that this
    is a warning and no fault.
    """

    def __init__(self, servos: Servos, control_rate: float, friction: float = 0.0):
        """A monitor before its first reading.

        Args:
            servos: of the arm.
            control_rate: readings a second [Hz].
            friction: of the gears, in the tension from currents [N]; zero if unknown.
        """
        self._servos = servos
        self._friction = friction or GEAR_FRICTION
        self._snap_readings = max(round(SNAP_TIME * control_rate), 3)
        self._stall_readings = max(round(STALL_TIME * control_rate), 3)
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self._last: Actions | None = None
        self._slack = np.zeros(len(self._servos.ids), int)
        # columns beyond the cables of a module never stall
        columns = max(map(len, self._servos.ids))
        self._stalled = np.zeros((len(self._servos.ids), columns), int)

    def find_fault(self, goal: Actions, displacements: Actions) -> str:
        """Describe a servo that does not reach its goal; empty if there is none.

        Args:
            goal: displacements sent last [m], shape (modules, cables).
            displacements: measured [m], same shape; NaN where missing.
        """
        away = np.abs(goal - displacements) > FOLLOWING_ERROR
        self._stalled = np.where(away, self._stalled + 1, 0)
        module, cable = np.unravel_index(np.argmax(self._stalled), away.shape)
        if self._stalled[module, cable] < self._stall_readings:
            return ""
        return (
            f"{self._name(int(module), int(cable))} does not follow: it is stalled, or "
            "its current limit is reached"
        )

    def find_slack(self, displacements: Actions, tensions: np.ndarray) -> str:
        """Describe a bent module without tension in any cable; empty if there is none.

        Args:
            displacements: measured [m], shape (modules, cables); NaN where missing.
            tensions: measured [N], same shape; NaN where missing.
        """
        carried = tensions + self._friction * self._direction(displacements)
        # comparisons with NaN are false: a missing measurement is no fault
        is_wound = displacements.min(axis=-1) < -WOUND_IN
        is_slack = (carried < SLACK).all(axis=-1)
        self._slack = np.where(is_wound & is_slack, self._slack + 1, 0)
        module = int(np.argmax(self._slack))
        if self._slack[module] < self._snap_readings:
            return ""
        cable = int(np.argmin(displacements[module]))
        return (
            f"the cable of {self._name(module, cable)} is wound in, and no cable of its "
            "module has tension: its load balances the module (in slow motion), or the "
            "cable may have snapped or left its pulley. If the error grows, stop the arm "
            "and run `s2c2a motors check`"
        )

    def _direction(self, displacements: Actions) -> np.ndarray:
        """1 where a cable is paid out, -1 where it is wound in, 0 where it stands."""
        last = displacements if self._last is None else self._last
        moved = displacements - last
        self._last = displacements
        return np.sign(moved) * (np.abs(moved) > MOVING)

    def _name(self, module: int, cable: int) -> str:
        id = self._servos.ids[module][cable]
        return f"servo {id} ({self._servos.number_of(id)})"
