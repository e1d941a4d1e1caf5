"""Whether a reading can be believed: there, fresh, of the right shape, plausible, neither jumping nor frozen."""

from collections.abc import Mapping, Sequence

import numpy as np

from s2c2a.spaces import Reading, Sensor

OLDEST = 3.0  # control periods that a reading may be behind
FROZEN_AFTER = 3  # steps without a changed bit, while commands moved by
MOVED = 0.02  # of a full bend


class ReadingCheck:
    """Looks at the sensors that are needed, reading by reading; the others may say what they like."""

    def __init__(
        self, sensors: Mapping[str, Sensor], needed: Sequence[str], period: float
    ):
        """Nothing seen yet.

        Args:
            sensors: what the body declares.
            needed: names of those that have to be sound.
            period: of the control steps [s].
        """
        self._sensors = sensors
        self._needed = tuple(needed)
        self._period = period
        self._rated = {
            name for name, one in sensors.items() if np.isfinite(one.fastest).any()
        }
        self.begin()

    def begin(self) -> None:
        """Forget what was seen: the arm was opened anew."""
        self._last: Reading | None = None
        self._same = dict.fromkeys(self._needed, 0)
        self._moved = 0.0
        self._before: dict[str, bytes] = {}
        self._heard: dict[str, np.ndarray] = {}

    def fault(self, reading: Reading, now: float, moved: float) -> str:
        """What is wrong with a reading, in words; nothing if it is sound, and the next one is then compared with it.

        Args:
            reading: the latest.
            now: seconds since the arm was opened, on the loop's clock.
            moved: size of the change that the last command made, in parts of the full
                bend.
        """
        said = self._stale(reading, now) or next(
            filter(None, (self._of(name, reading) for name in self._needed)), ""
        )
        said = said or self._frozen(reading, moved)
        if not said:
            self._last = reading
        return said

    def _stale(self, reading: Reading, now: float) -> str:
        if not np.isfinite(reading.time):
            return "the reading has no time"
        if self._last is not None and reading.time <= self._last.time:
            return "the reading is no newer than the last one"
        late = now - reading.time
        return (
            f"the reading is {late:.2f} s old" if late > OLDEST * self._period else ""
        )

    def _of(self, name: str, reading: Reading) -> str:
        values = reading.get(name)
        sensor = self._sensors.get(name)
        heard = self._heard.pop(name, None)
        if values is None or sensor is None:
            return f"'{name}' is missing"
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
            return f"'{name}' is no array of numbers"
        if values.shape != sensor.shape:
            return f"'{name}' is of shape {values.shape}, not {sensor.shape}"
        if not np.isfinite(values).all():
            return f"'{name}' is not finite"
        if not ((values >= sensor.low) & (values <= sensor.high)).all():
            return f"'{name}' is out of its range"
        self._heard[name] = values
        return (
            f"'{name}' has jumped"
            if name in self._rated and self._jumped(name, reading, heard)
            else ""
        )

    def _jumped(self, name: str, reading: Reading, heard: np.ndarray | None) -> bool:
        """Whether numbers cannot have come about since the last sound reading, or what was heard just before.

        The longer the sound one is ago, the further they may be; but then they must fit
        what was just heard, too.
        """
        if self._last is None:
            return False
        values = reading[name]
        fastest = self._sensors[name].fastest
        way = np.abs(values - self._last[name])
        since = max(reading.time - self._last.time, self._period)
        if (way > fastest * since).any():
            return True
        near = fastest * self._period
        return heard is not None and bool(
            (way > near).any() and (np.abs(values - heard) > near).any()
        )

    def _frozen(self, reading: Reading, moved: float) -> str:
        """Whether a sensor has said the same to the last bit for some steps, while the arm was told to move."""
        for name in self._needed:
            bits = np.ascontiguousarray(reading[name]).tobytes()
            still = self._before.get(name) == bits
            self._before[name] = bits
            self._same[name] = (
                self._same[name] + 1 if still and (moved > 0 or self._same[name]) else 0
            )
        self._moved = self._moved + moved if any(self._same.values()) else 0.0
        frozen = [name for name, steps in self._same.items() if steps >= FROZEN_AFTER]
        return f"'{frozen[0]}' is frozen" if frozen and self._moved > MOVED else ""
