"""Faults of the simulated arm's sensors, such as drift, latency or exchanged modules."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from s2c2a.robots.simulation.random_streams import Stream, random_stream

KINDS = {
    "offset": 1,  # of the first value of every module, in the sensor's unit
    "drift": 1,  # the same, in its unit per second
    "noise": 1,  # standard deviation, in its unit
    "latency": 1,  # s
    "negated": 0,
    "zeros": 0,
    "frozen": 0,
    "reversed": 0,  # the last module's values come first; not for a single number
    "repaired": 0,
}
"""Kinds of faults, and how many numbers each needs."""
MAX_LATENCY = 10.0  # s; readings of this time stay in memory


@dataclass(frozen=True)
class _Fault:
    kind: str
    amount: float
    began: float  # s


class SensorFaults:
    """The faults of one run; the last fault of a sensor replaces the one before."""

    def __init__(self, seed: int):
        """Begin without faults."""
        self._random = random_stream(seed, Stream.SENSOR_FAULTS)
        self._faults: dict[str, _Fault] = {}
        self._frozen: dict[str, np.ndarray] = {}
        self._past: deque[tuple[float, Mapping[str, np.ndarray]]] = deque()

    def set(self, sensor: str, kind: str, amount: float, time: float) -> None:
        """Give a sensor a fault.

        Args:
            sensor: name in readings.
            kind: a name in `KINDS`.
            amount: its number, or zero.
            time: now [s].
        """
        self._faults[sensor] = _Fault(kind, amount, time)
        self._frozen.pop(sensor, None)

    def apply(
        self, values: Mapping[str, np.ndarray], time: float
    ) -> dict[str, np.ndarray]:
        """Return the values of all sensors with their faults.

        Args:
            values: of a reading, by sensor.
            time: of the reading [s].
        """
        if not self._past or time > self._past[-1][0]:
            self._past.append((time, values))
        # the last reading of `MAX_LATENCY` ago, or an earlier one, stays
        while len(self._past) > 1 and time - self._past[1][0] >= MAX_LATENCY:
            self._past.popleft()
        changed = dict(values)
        for name, fault in self._faults.items():
            if name in values:
                changed[name] = self._changed(name, fault, values[name], time)
        return changed

    def _changed(
        self, name: str, fault: _Fault, values: np.ndarray, time: float
    ) -> np.ndarray:
        amount = fault.amount
        # one for the first value of every module, or for a single number; else zero
        shape = np.shape(values)
        first = np.zeros(shape or 1)
        first[..., 0] = 1.0
        first = first.reshape(shape)
        match fault.kind:
            case "offset":
                return values + amount * first
            case "drift":
                return values + amount * (time - fault.began) * first
            case "noise":
                return values + self._random.normal(0.0, amount, np.shape(values))
            case "latency":
                return self._at(name, time - amount, values)
            case "frozen":
                # kept here, since past readings are forgotten after a while
                held = self._at(name, fault.began, values)
                return self._frozen.setdefault(name, held)
            case "negated":
                return -values
            case "zeros":
                return np.zeros_like(values)
            case "reversed" if np.ndim(values) > 1:
                return np.flip(values, axis=-2)
        return values

    def _at(self, name: str, time: float, values: np.ndarray) -> np.ndarray:
        """The last value until a time; the earliest if there is none."""
        seen = [(moment, past[name]) for moment, past in self._past if name in past]
        earlier = [past for moment, past in seen if moment <= time + 1e-9]
        if earlier:
            return earlier[-1]
        return seen[0][1] if seen else values
