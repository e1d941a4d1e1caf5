"""Plausibility check of readings: present, recent, in range, not jumping, not frozen."""

from collections.abc import Mapping, Sequence

import numpy as np

from s2c2a.repeats import RepeatDetector
from s2c2a.spaces import Reading, Sensor

MAX_AGE = 3.0  # control periods
FROZEN_STEPS = 3  # steps with the same bits
FROZEN_CHANGE = 0.02  # of the full bend: change of commands in these steps
# the same for sensors of the modules, which rest while cables move within their backlash
FROZEN_CHANGE_OF_MODULES = 0.3
MODULE_SENSORS = ("states", "configurations")


class ReadingCheck:
    """Checks the required sensors of every reading; other sensors are not checked."""

    def __init__(
        self, sensors: Mapping[str, Sensor], required: Sequence[str], period: float
    ):
        """A check before its first reading.

        Args:
            sensors: sensors that the robot declares, by name.
            required: names of the sensors that must be sound.
            period: of the control steps [s].
        """
        self._sensors = sensors
        self._required = tuple(required)
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Forget all readings, as after the robot was opened again."""
        self._last_sound: Reading | None = None
        self._last_values: dict[str, np.ndarray] = {}
        self._repeats = RepeatDetector()
        self._repeat_counts = dict.fromkeys(self._required, 0)
        self._changes_while_repeated = dict.fromkeys(self._required, 0.0)

    def find_fault(self, reading: Reading, now: float, last_change: float) -> str:
        """Describe what is wrong with a reading; empty if it is sound.

        A sound reading becomes the one that the next reading is compared with.

        Args:
            reading: latest reading.
            now: seconds since the robot was opened, on the loop's clock.
            last_change: size of the change that the last command made, as a fraction
                of the full bend.
        """
        fault = reading.fault or self._time_fault(reading, now)
        for name in self._required:
            fault = fault or self._value_fault(name, reading)
        fault = fault or self._frozen_fault(reading, last_change)
        if not fault:
            self._last_sound = reading
        return fault

    def _time_fault(self, reading: Reading, now: float) -> str:
        if not np.isfinite(reading.time):
            return "the reading has no time"
        if self._last_sound is not None and reading.time <= self._last_sound.time:
            return "the reading is no newer than the last one"
        age = now - reading.time
        if age > MAX_AGE * self._period:
            return f"the reading is {age:.2f} s old"
        return ""

    def _value_fault(self, name: str, reading: Reading) -> str:
        values = reading.get(name)
        sensor = self._sensors.get(name)
        previous = self._last_values.pop(name, None)
        if values is None or sensor is None:
            return f"'{name}' is missing"
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
            return f"'{name}' is not an array of numbers"
        if values.shape != sensor.shape:
            return f"'{name}' has shape {values.shape}, expected {sensor.shape}"
        if not np.isfinite(values).all():
            return f"'{name}' is not finite"
        if not ((values >= sensor.low) & (values <= sensor.high)).all():
            return f"'{name}' is out of its range"
        self._last_values[name] = values
        if self._has_jumped(name, reading, previous):
            return f"'{name}' has jumped"
        return ""

    def _has_jumped(
        self, name: str, reading: Reading, previous: np.ndarray | None
    ) -> bool:
        """Whether values changed faster than the sensor can.

        The longer ago the last sound reading is, the further values may be from it;
        but then they must fit the previous, unsound reading, too.
        """
        max_rate = self._sensors[name].fastest
        if self._last_sound is None or not np.isfinite(max_rate).any():
            return False
        values = reading[name]
        change = np.abs(values - self._last_sound[name])
        elapsed = max(reading.time - self._last_sound.time, self._period)
        if (change > max_rate * elapsed).any():
            return True
        step = max_rate * self._period
        if previous is None or (change <= step).all():
            return False
        return bool((np.abs(values - previous) > step).any())

    def _frozen_fault(self, reading: Reading, last_change: float) -> str:
        """Detect sensors whose values repeat for some steps while commands change."""
        counts = self._repeat_counts
        changes = self._changes_while_repeated
        frozen = []
        for name in self._required:
            repeated = self._repeats.is_repeated(name, reading[name])
            # repetitions of an arm at rest do not count
            suspicious = repeated and (last_change > 0 or counts[name] > 0)
            counts[name] = counts[name] + 1 if suspicious else 0
            changes[name] = changes[name] + last_change if suspicious else 0.0
            if counts[name] >= FROZEN_STEPS and changes[name] > _frozen_change(name):
                frozen.append(name)
        return f"'{frozen[0]}' is frozen" if frozen else ""


def _frozen_change(name: str) -> float:
    """Change of commands that a sensor must show, as a fraction of the full bend."""
    return FROZEN_CHANGE_OF_MODULES if name in MODULE_SENSORS else FROZEN_CHANGE
