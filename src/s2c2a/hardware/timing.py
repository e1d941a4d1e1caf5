"""Timing of a servo bus: how long a cycle takes, and how often it is late."""

import time
from dataclasses import dataclass

import numpy as np

from s2c2a.arm import Servos
from s2c2a.hardware.bus import Mode, ServoBus
from s2c2a.progress import Progress, quiet

LATE = 0.1  # part of a period; a cycle with a longer delay counts as late


@dataclass(frozen=True)
class BusTiming:
    """Times of cycles that send all goals and read all states.

    Attributes:
        durations: of the cycles [s].
        late: number of cycles that began late.
        incomplete: number of cycles in which a servo did not answer.
    """

    durations: np.ndarray
    late: int
    incomplete: int


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
        bus: of the servos.
        servos: of the arm.
        rate: cycles a second [Hz].
        cycles: number of cycles.
        progress: called with a label, the number done and the total.

    Raises:
        BusError: a servo does not answer while it is prepared, or the port is gone.
    """
    ids = [id for row in servos.ids for id in row]
    bus.prepare(ids, Mode.CURRENT_LIMITED_POSITION, servos.home_current, 1.0)
    goals = {id: state.position for id, state in bus.read_patiently(ids, 1.0).items()}
    durations = np.zeros(cycles)
    late = 0
    incomplete = 0
    due = time.perf_counter()
    for cycle in range(cycles):
        time.sleep(max(due - time.perf_counter(), 0.0))
        began = time.perf_counter()
        late += began - due > LATE / rate
        bus.send_goals(goals)
        incomplete += len(bus.read_states(ids)) < len(ids)
        durations[cycle] = time.perf_counter() - began
        due = max(due + 1.0 / rate, began)
        if cycle % 100 == 99:
            progress("timing", cycle + 1, cycles)
    return BusTiming(durations, late, incomplete)
