"""Plausibility check of readings: present, recent, in range, steady, following commands."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from s2c2a.measurements.following import FollowingMonitor
from s2c2a.measurements.repeats import RepeatDetector
from s2c2a.spaces import Reading, Sensor

MAX_SILENCE = 3
"""Control periods without news of a sensor: two measurements in a row may be lost, late,
or repeated by a slow sensor."""
FROZEN_CHANGE = 0.02
"""Change of the commands meanwhile, of the full bend: 30 encoder ticks of `twin_arm`."""
FROZEN_CHANGE_OF_MODULES = 0.3
"""The same for sensors of the modules, which rest while cables move within their
backlash."""
CABLES = "cables"  # the sensor that commands are compared with
MODULE_SENSORS = ("states", "configurations")


class ReadingCheck:
    """Checks the required sensors of every reading; other sensors are not checked."""

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        required: Sequence[str],
        period: float,
        following: FollowingMonitor | None = None,
        steps: int = 1,
    ):
        """A check before its first reading.

        Args:
            sensors: sensors that the robot declares, by name.
            required: names of the sensors that must be sound.
            period: of the sensors [s].
            following: compares the cables with the commands; None compares nothing.
            steps: control steps in a period, in which a sensor may show the same.
        """
        self._following = following
        self._sensors = dict(sensors)
        self._required = tuple(required)
        self._period = period
        self._steps = steps
        self.reset()

    def reset(self) -> None:
        """Forget all readings, as after the robot was opened again."""
        self._last_sound_time: float | None = None
        self._repeated_times = 0
        # of each sensor: time and values of its last measurement, and of its last
        # sound one, whatever was wrong with other sensors
        self._last: dict[str, tuple[float, np.ndarray]] = {}
        self._last_sound: dict[str, tuple[float, np.ndarray]] = {}
        self._repeats = RepeatDetector()
        self._repeat_counts = dict.fromkeys(self._required, 0)
        self._changes_while_repeated = dict.fromkeys(self._required, 0.0)

    def find_fault(self, reading: Reading, now: float, last_change: float) -> str:
        """Describe what is wrong with a reading; empty if it is sound.

        Every sensor is compared with its own last sound measurement.

        Args:
            reading: latest reading.
            now: seconds since the robot was opened, on the loop's clock.
            last_change: size of the change that the last command made, as a fraction
                of the full bend.
        """
        fault = reading.fault or self._time_fault(reading, now)
        if not fault:
            faults = [self._value_fault(name, reading) for name in self._required]
            fault = next(filter(None, faults), "")
        fault = fault or self._frozen_fault(reading, last_change)
        if CABLES not in self._required:
            fault = fault or self._following_fault(CABLES, reading)
        if not fault:
            self._last_sound_time = reading.time
        return fault

    def _time_fault(self, reading: Reading, now: float) -> str:
        if not np.isfinite(reading.time):
            return "the reading has no time"
        last = self._last_sound_time
        self._repeated_times = self._repeated_times + 1 if reading.time == last else 0
        is_older = last is not None and reading.time < last
        # it may be repeated within a period of the sensors
        if is_older or self._repeated_times >= self._steps:
            return "the reading is no newer than the last one"
        age = now - reading.time
        if age > MAX_SILENCE * self._period:
            return f"the reading is {age:.2f} s old"
        return ""

    def _value_fault(self, name: str, reading: Reading) -> str:
        values = reading.get(name)
        sensor = self._sensors.get(name)
        previous = self._last.pop(name, None)
        if values is None or sensor is None:
            return f"'{name}' is missing"
        if fault := describe_values(name, values, sensor):
            return fault
        self._last[name] = (reading.time, values)
        if self._has_jumped(name, reading, previous):
            return f"'{name}' has jumped"
        fault = self._following_fault(name, reading)
        if not fault:
            self._last_sound[name] = (reading.time, values)
        return fault

    def _following_fault(self, name: str, reading: Reading) -> str:
        if name != CABLES or self._following is None:
            return ""
        return self._following.find_fault(reading)

    def _has_jumped(
        self, name: str, reading: Reading, previous: tuple[float, np.ndarray] | None
    ) -> bool:
        """Whether values changed faster than the sensor can.

        The longer ago the last sound reading is, the further values may be from it;
        but then they must fit the previous, unsound measurement, too.
        """
        max_rate = self._sensors[name].fastest
        if name not in self._last_sound or not np.isfinite(max_rate).any():
            return False
        change, allowed = self._change_since(self._last_sound[name], name, reading)
        if (change > allowed).any():
            return True
        if previous is None or (change <= max_rate * self._period).all():
            return False
        change, allowed = self._change_since(previous, name, reading)
        return bool((change > allowed).any())

    def _change_since(
        self, earlier: tuple[float, np.ndarray], name: str, reading: Reading
    ) -> tuple[np.ndarray, np.ndarray]:
        """Change of a sensor since an earlier measurement, and the largest possible."""
        time, values = earlier
        elapsed = max(reading.time - time, self._period)
        largest = np.asarray(self._sensors[name].fastest * elapsed)
        # differences of unsigned integers would wrap around
        change = np.subtract(reading[name], values, dtype=float)
        return np.abs(change), largest

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
            # what a sensor must show, as a fraction of the full bend
            shown = (
                FROZEN_CHANGE_OF_MODULES if name in MODULE_SENSORS else FROZEN_CHANGE
            )
            if counts[name] >= MAX_SILENCE * self._steps and changes[name] > shown:
                frozen.append(name)
        return f"'{frozen[0]}' is frozen" if frozen else ""


def describe_values(
    name: str, values: Any, sensor: Sensor, may_miss: bool = False
) -> str:
    """Describe what is wrong with the values of a sensor; empty if they are sound.

    Args:
        name: of the sensor.
        values: of a reading; anything, since a robot may be anybody's.
        sensor: declaration of the sensor.
        may_miss: whether values may be NaN where nothing was measured.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
        return f"'{name}' is not an array of numbers"
    if values.shape != sensor.shape:
        return f"'{name}' has shape {values.shape}, declared as {sensor.shape}"
    is_finite = np.isfinite(values)
    if not may_miss and not is_finite.all():
        return f"'{name}' is not finite"
    in_range = (values >= sensor.low) & (values <= sensor.high)
    return "" if (in_range | ~is_finite).all() else f"'{name}' is out of its range"
