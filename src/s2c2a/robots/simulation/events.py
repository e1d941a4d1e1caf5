"""Scheduled disturbances and faults of a simulated robot."""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from s2c2a.arm.spec import MAX_PAYLOAD
from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.robots.simulation import sensor_faults

if TYPE_CHECKING:
    from s2c2a.robots.simulation.simulated_robot import SimulatedRobot

EXAMPLE = "8 payload 0.05; 10 force 0.3 0 0; 12 force 0 0 0"


KINDS = {
    "payload": 1,  # kg
    "force": 3,  # N; x, y, z at the tip
    "homing_error": 1,  # m
    "stiffness_loss": 1,  # share of the stiffness of a cable
    "sensor_loss": 0,
}
"""Kinds of events, and how many numbers each needs.

The kinds in `sensor_faults.KINDS` need the name of a sensor before their numbers.
"""


class Event(NamedTuple):
    """One scheduled disturbance or fault.

    Attributes:
        time: when it occurs [s].
        kind: a name in `KINDS` or `sensor_faults.KINDS`.
        values: its numbers, in the unit of the kind.
        sensor: with the fault; empty for other events.
    """

    time: float
    kind: str
    values: tuple[float, ...]
    sensor: str = ""

    @property
    def is_sensor_fault(self) -> bool:
        """Whether it changes the readings of one sensor."""
        return self.kind in sensor_faults.KINDS


def parse_events(texts: str | Sequence[str]) -> tuple[Event, ...]:
    """Parse events such as `EXAMPLE`, sorted by time.

    Args:
        texts: one text, or several; each holds events separated by semicolons.

    Raises:
        S2C2AError: an event has no valid time, kind or numbers.
    """
    joined = texts if isinstance(texts, str) else ";".join(texts)
    events = [_parse_event(text) for text in joined.split(";") if text.strip()]
    return tuple(sorted(events, key=attrgetter("time")))


def _parse_event(text: str) -> Event:
    words = text.split()
    try:
        sensor = words.pop(2) if words[1] in sensor_faults.KINDS else ""
        values = tuple(map(float, words[2:]))
        event = Event(float(words[0]), words[1], values, sensor)
    except (ValueError, IndexError) as error:
        raise _invalid_event(text) from error
    if not _is_valid(event):
        raise _invalid_event(text)
    return event


def _is_valid(event: Event) -> bool:
    counts = KINDS | sensor_faults.KINDS
    if len(event.values) != counts.get(event.kind):
        return False
    if event.time < 0 or not np.isfinite([event.time, *event.values]).all():
        return False
    if event.kind == "payload":
        return 0 <= event.values[0] <= MAX_PAYLOAD
    if event.kind == "stiffness_loss":
        return 0 <= event.values[0] < 1
    if event.kind == "latency":
        return 0 <= event.values[0] <= sensor_faults.MAX_LATENCY
    if event.kind == "noise":
        return event.values[0] >= 0
    return True


def _invalid_event(text: str) -> S2C2AError:
    names = [*KINDS, *sensor_faults.KINDS]
    kind = "".join(text.split()[1:2])
    advice = "" if kind in names else did_you_mean(kind, names)
    kinds = [f"{kind} ({count} numbers)" for kind, count in KINDS.items()]
    faults = [f"{kind} ({count})" for kind, count in sensor_faults.KINDS.items()]
    return S2C2AError(
        f"'{text.strip()}' is not an event{advice}; write a time [s], a "
        f"kind and its numbers: "
        f"{', '.join(kinds)}; or a time, a fault, a sensor and the fault's numbers: "
        f'{", ".join(faults)}; for example "{EXAMPLE}", '
        '"8 latency camera_positions 2"'
    )


class EventSchedule:
    """Events of one run that are still to come."""

    def __init__(self, events: Sequence[Event]):
        """Begin with all events, sorted by time."""
        self._pending = list(events)

    def apply_until(self, time: float, robot: "SimulatedRobot") -> None:
        """Apply all events that are due at `time` [s]."""
        while self._pending and self._pending[0].time <= time + 1e-9:
            event = self._pending.pop(0)
            methods: dict[str, Callable[..., None]] = {
                "payload": robot.set_payload,
                "homing_error": robot.add_homing_error,
                "stiffness_loss": robot.reduce_cable_stiffness,
                "sensor_loss": robot.lose_sensors,
            }
            if event.is_sensor_fault:
                robot.set_sensor_fault(event.sensor, event.kind, *event.values)
            elif event.kind == "force":
                robot.apply_force(np.asarray(event.values))
            else:
                methods[event.kind](*event.values)
