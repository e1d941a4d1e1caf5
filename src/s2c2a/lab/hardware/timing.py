"""Timing of a servo bus: how long a cycle takes, and how often it is late."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from s2c2a.arm import Servos
from s2c2a.execution.progress import Progress, quiet
from s2c2a.lab.hardware.bus import BusError, ServoBus
from s2c2a.lab.hardware.monitor import describe_faults
from s2c2a.lab.hardware.presence import ALL_SILENT, SOME_SILENT, Place
from s2c2a.runtime.emergency import EMERGENCY_STOP

LATE = 0.1  # part of a period; a cycle with a longer delay counts as late
MAX_INCOMPLETE = 0.01
"""Largest part of incomplete cycles. The control loop asks again; against emulated
servos, 1 % of lost answers does not change a motion."""


@dataclass(frozen=True)
class BusTiming:
    """Times of cycles that send all goals and read all states.

    Attributes:
        durations: of the cycles [s].
        late: number of cycles that began late.
        incomplete: number of cycles in which a servo did not answer.
        missed: number of cycles without an answer, by id of the servo.
        period: between two cycles, as it was asked for [s].
    """

    durations: np.ndarray
    late: int
    incomplete: int
    missed: Mapping[int, int]
    period: float

    def fault(self, place: Place) -> str:
        """Describe why the bus is not fit for a control loop; empty if it is.

        Args:
            place: of a servo, for users.
        """
        cycles = len(self.durations)
        if self.incomplete > MAX_INCOMPLETE * cycles:
            missed = self.missed
            if min(missed.values()) == cycles:
                return f"none of the {len(missed)} servos answers in any cycle; {ALL_SILENT}"
            worst = max(missed, key=lambda id: missed[id])
            return (
                f"servo {worst} ({place(worst)}) is missing in {missed[worst]} of {cycles} "
                f"cycles; {SOME_SILENT}. Damaged answers count as missing: "
                "look for a loose plug, and for two servos with one id"
            )
        median = float(np.median(self.durations))
        if median > self.period:
            return (
                f"a cycle takes {1000 * median:.1f} ms, longer than the period of "
                f"{1000 * self.period:.1f} ms; lower the rate, raise the baud rate, set "
                "the latency timer of the adapter to 1 ms, or try --fast-read"
            )
        return ""


def prepare_timing(bus: ServoBus, servos: Servos) -> None:
    """Prepare servos for `measure_timing`; their torque is off afterwards.

    Raises:
        BusError: a servo does not answer, or it is another model.
    """
    for part, ids in servos.parts():
        bus.prepare(ids, part.home_current, 1.0)


def measure_timing(
    bus: ServoBus,
    servos: Servos,
    rate: float,
    cycles: int,
    progress: Progress = quiet,
) -> BusTiming:
    """Send goals and read states at a rate, with the torque off: nothing moves.

    Feetech servos get no goals, which would switch their torque on; their times are
    those of reading.

    Args:
        bus: of the servos, which `prepare_timing` has prepared.
        servos: of the arm.
        rate: cycles a second [Hz].
        cycles: number of cycles.
        progress: called with a label, the number done and the total.

    Raises:
        PortLostError: the port is gone.
        BusError: a servo has restarted.
        EmergencyStopError: the emergency stop was triggered.
    """
    ids = [id for row in servos.ids for id in row]
    goals = {id: state.position for id, state in bus.read_patiently(ids, 1.0).items()}
    durations = np.zeros(cycles)
    late = 0
    incomplete = 0
    missed = dict.fromkeys(ids, 0)
    due = time.perf_counter()
    for cycle in range(cycles):
        EMERGENCY_STOP.check()
        time.sleep(max(due - time.perf_counter(), 0.0))
        began = time.perf_counter()
        late += began - due > LATE / rate
        bus.send_goals(goals)
        states = bus.read_states(ids)
        incomplete += len(states) < len(ids)
        for id in set(ids) - states.keys():
            missed[id] += 1
        durations[cycle] = time.perf_counter() - began
        due = max(due + 1.0 / rate, began)
        if cycle % 100 == 99:
            progress("timing", cycle + 1, cycles)
    if bus.restarted:
        raise BusError(
            describe_faults({}, servos, sorted(bus.restarted), bus.restarted)
        )
    return BusTiming(durations, late, incomplete, missed, 1.0 / rate)
