"""Faults of servos and cables, in words."""

from collections.abc import Iterable, Mapping

import numpy as np

from s2c2a.arm import Servos
from s2c2a.hardware.bus import ServoState
from s2c2a.spaces import Actions

TAUT = 1.0  # N; of a cable that carries
SLACK = 0.15  # N; of a cable that carries nothing, with the noise of the current
PAID_OUT = 0.002  # m; a cable that is paid out by more may go slack
CONFIRMATIONS = 3  # readings
FOLLOWING_ERROR = 0.004  # m
STALL_READINGS = 10


def describe_faults(
    states: Mapping[int, ServoState], servos: Servos, ids: Iterable[int]
) -> str:
    """Describe the first fault of an arm's servos; empty if there is none.

    Args:
        states: by id; a servo that did not answer is missing.
        servos: of the arm, with their limits.
        ids: servos that were read.
    """
    for id in ids:
        fault = _servo_fault(states.get(id), servos)
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
    """Finds cables that snapped or left their pulley, and servos that stall."""

    def __init__(self, servos: Servos):
        """A monitor before its first reading."""
        self._servos = servos
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self._taut_at: Actions | None = None
        self._lost = np.zeros(np.shape(self._servos.ids), int)
        self._stalled = np.zeros(np.shape(self._servos.ids), int)

    def find_fault(
        self, goal: Actions, displacements: Actions, tensions: np.ndarray
    ) -> str:
        """Describe a fault of a cable; empty if there is none.

        Args:
            goal: displacements that were sent last [m], shape (modules, cables).
            displacements: measured [m]; NaN where missing.
            tensions: measured [N]; NaN where missing.
        """
        if fault := self._snapped(displacements, tensions):
            return fault
        return self._stall(goal, displacements)

    def _snapped(self, displacements: Actions, tensions: np.ndarray) -> str:
        """A cable that carried and carries nothing, though it was not paid out."""
        if self._taut_at is None:
            self._taut_at = np.full(displacements.shape, np.nan)
        taut = tensions > TAUT
        self._taut_at = np.where(taut, displacements, self._taut_at)
        paid_out = displacements - self._taut_at
        # comparisons with NaN are false: what never carried cannot be lost
        lost = (tensions < SLACK) & (paid_out < PAID_OUT)
        self._lost = np.where(lost, self._lost + 1, 0)
        if (self._lost < CONFIRMATIONS).all():
            return ""
        return (
            f"the cable of {self._name(self._lost)} has no tension any more: it has "
            "snapped, or left its pulley"
        )

    def _stall(self, goal: Actions, displacements: Actions) -> str:
        """A servo that does not arrive."""
        away = np.abs(goal - displacements) > FOLLOWING_ERROR
        self._stalled = np.where(away, self._stalled + 1, 0)
        if (self._stalled < STALL_READINGS).all():
            return ""
        return (
            f"{self._name(self._stalled)} does not follow: it is stalled, or its "
            "current limit is reached"
        )

    def _name(self, counts: np.ndarray) -> str:
        """The servo with the largest count."""
        module, cable = np.unravel_index(np.argmax(counts), counts.shape)
        id = self._servos.ids[module][cable]
        return f"servo {id} ({self._servos.number_of(id)})"
