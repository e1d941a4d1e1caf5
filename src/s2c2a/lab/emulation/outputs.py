"""Outputs of an emulator: a status file, and a record of positions."""

import json
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from s2c2a.errors import S2C2AError
from s2c2a.files.text import write_atomically

if TYPE_CHECKING:
    from s2c2a.lab.emulation.emulator import Emulator

STATUS_PERIOD = 0.25  # s


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port of a text HOST:PORT.

    Raises:
        S2C2AError: it is no such text.
    """
    host, _, port = text.rpartition(":")
    if not (host and port.isdecimal() and 0 < int(port) < 65_536):
        raise S2C2AError(
            f"'{text}' is not an address; write HOST:PORT, such as 127.0.0.1:9700"
        )
    return host, int(port)


class Periodic:
    """Schedules what repeats."""

    def __init__(self, period: float):
        """Begin due at once.

        Args:
            period: between two times [s].
        """
        self._period = period
        self._next = 0.0

    def is_due(self, now: float) -> bool:
        """Return whether the time has come, once for each; missed times are lost."""
        if now < self._next:
            return False
        self._next = max(self._next + self._period, now)
        return True


class StatusFile:
    """JSON file with the state of all servos, written a few times a second.

    A thread writes it: a busy disk must not stop the servos.
    """

    def __init__(self, path: Path):
        """Choose the file."""
        self._path = path
        self._due = Periodic(STATUS_PERIOD)
        self._writer = ThreadPoolExecutor(1, "status-file")
        self._written: Future | None = None

    def write(self, emulator: "Emulator", now: float) -> None:
        """Write the file if it is due and the last one has been written.

        Raises:
            S2C2AError: the last one could not be written.
        """
        is_busy = self._written is not None and not self._written.done()
        if is_busy or not self._due.is_due(now):
            return
        if self._written is not None:
            self._written.result()
        text = json.dumps(describe(emulator), indent=1)
        self._written = self._writer.submit(write_atomically, text, self._path)

    def close(self) -> None:
        """Wait until the last file is complete."""
        self._writer.shutdown()


def describe(emulator: "Emulator") -> dict[str, Any]:
    """Return the state of an emulator as plain values.

    `largest_command` [m] and `largest_current` [A] are over the whole time, from goals
    of powered motors and from measurements.
    """
    plant = emulator.plant
    return {
        "time": emulator.now,
        "late": emulator.late,
        "packets": emulator.packet_count,
        "voltage": emulator.voltage,
        "plugged": all(line.is_plugged for line in emulator.lines),
        "largest_command": emulator.largest_command,
        "largest_current": emulator.largest_current,
        "servos": [
            {
                "id": winch.servo.id,
                "torque": winch.servo.torque,
                "position": round(winch.servo.position),
                "displacement": float(plant.positions[winch.cable]),
                "goal": float(plant.targets.goal[winch.cable]),
                "current": winch.servo.state.current,
                "tension": float(plant.tensions[winch.cable]),
                "temperature": winch.servo.temperature,
                "errors": list(winch.servo.errors),
                "watchdog_tripped": winch.servo.watchdog_tripped,
            }
            for winch in emulator.winches
        ],
    }


class PositionRecord:
    """CSV file with the time and the true positions of the module ends [m]."""

    def __init__(self, path: Path, modules: int, rate: float):
        """Create the file.

        Args:
            path: the file; replaced if it exists.
            modules: number of modules.
            rate: rows a second [Hz].

        Raises:
            S2C2AError: the file cannot be written.
        """
        try:
            self._file = path.open("w", encoding="utf-8")
        except OSError as error:
            raise S2C2AError(
                f"cannot write {path}: {error}; choose another --record"
            ) from error
        self._due = Periodic(1.0 / rate)
        names = [f"{axis}{number + 1}" for number in range(modules) for axis in "xyz"]
        print("time", *names, sep=",", file=self._file)

    def write(self, emulator: "Emulator", now: float) -> None:
        """Write a row if it is due."""
        if not self._due.is_due(now):
            return
        values = emulator.plant.states()[:, :3].ravel()
        texts = [f"{value:.6f}" for value in (now, *values)]
        print(*texts, sep=",", file=self._file)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
