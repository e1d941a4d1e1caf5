"""From readings to what an observer hears: nothing (NaN) of what is missing, broken, or was said before."""

from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.estimation.sensors import Sense
from s2c2a.kinematics import configurations_from_states
from s2c2a.spaces import Reading

# m/s2 and rad/s; beyond any such sensor
MAX_FORCE = 500.0
MAX_RATE = 100.0
# s; over which forces tell which way is down, and what that needs at the start
SMOOTHED = 1.0
SETTLED = 4.0


class Listener:
    """Hears what sensors say, reading by reading."""

    def __init__(self, arm: ArmSpec, sensors: tuple[Sense, ...]):
        """For sensors of an arm."""
        self._silent = {
            name: value for sense in sensors for name, value in sense.silent().items()
        }
        self._inertial = Inclinometer(arm) if "inclinations" in self._silent else None
        self.begin()

    def begin(self) -> None:
        """Forget what was heard."""
        self._bits: dict[str, bytes] = {}
        if self._inertial is not None:
            self._inertial.begin()

    def heard(self, reading: Reading) -> dict[str, np.ndarray]:
        """What is said, in single precision, by name."""
        return {
            name: self._of(name, silent, reading)
            for name, silent in self._silent.items()
        }

    def _of(self, name: str, silent: np.ndarray, reading: Reading) -> np.ndarray:
        found = numbers(self._said(name, reading), silent.shape)
        if found is None:
            return silent
        with np.errstate(over="ignore"):  # too large a number is none
            found = found.astype(np.float32)
        bits = found.tobytes()
        said_before = bits == self._bits.get(name)
        self._bits[name] = bits
        # one number, such as an age, may well be the same
        return silent if said_before and found.ndim else found

    def _said(self, name: str, reading: Reading) -> Any:
        if name == "inclinations" and self._inertial is not None:
            return self._inertial.told(reading)
        if name == "configurations" and reading.get(name) is None:
            states = numbers(reading.get("states"), (len(self._silent[name]), 6))
            return None if states is None else configurations_from_states(states)
        return reading.get(name)


def numbers(values: Any, shape: tuple[int | None, ...]) -> np.ndarray | None:
    """What a body says, as numbers of a shape (None: any length but zero); None if it is something else."""
    try:
        found = np.asarray(values, float)
    except (TypeError, ValueError):
        return None
    fits = found.ndim == len(shape) and all(
        have == want if want is not None else have
        for have, want in zip(found.shape, shape, strict=True)
    )
    return found if fits else None


class Inclinometer:
    """Which way is down in the frames of inertial sensors: what they accelerate by, smoothed along how they turn.

    The filter is VQF (Laidig and Seel 2023, Information Fusion 91), which also finds
    the zeros of the turn rates.
    """

    def __init__(self, arm: ArmSpec):
        """For the inertial sensors of an arm.

        Raises:
            S2C2AError: the filter is not installed.
        """
        try:
            from vqf import VQF
        except ImportError as error:
            raise S2C2AError(
                "inertial sensors need the package vqf; install it with `pip install 's2c2a[sensors]'`, or leave "
                "[sensors.imu] out of the arm file"
            ) from error
        self._new = VQF
        self._arm = arm
        self.begin()

    def begin(self) -> None:
        """Forget what was turned."""
        self._filters: list[Any] = []
        self._last: bytes = b""
        self._told: Float[np.ndarray, "modules 3"] | None = None

    def told(self, reading: Reading) -> Float[np.ndarray, "modules 3"] | None:
        """Unit vectors that point down, each in its sensor's frame; None where nothing is said."""
        shape = None, self._arm.module_count, 3
        forces, turns = (
            numbers(reading.get(name), shape)
            for name in ("accelerations", "angular_velocities")
        )
        if forces is None or turns is None or forces.shape != turns.shape:
            return None
        if not (
            (np.abs(forces) < MAX_FORCE).all() and (np.abs(turns) < MAX_RATE).all()
        ):
            return None  # the filter would never forget it
        if (bits := forces.tobytes()) == self._last:  # said before: nothing new
            return self._told
        self._last = bits
        if not self._filters:
            period = self._arm.control_period / len(forces)
            self._filters = [
                self._new(period, tauAcc=SMOOTHED) for _ in range(forces.shape[1])
            ]
            self._settle(forces)
        self._told = np.stack(
            [
                _down(one, forces[:, k], turns[:, k])
                for k, one in enumerate(self._filters)
            ]
        )
        return self._told

    def _settle(self, forces: np.ndarray) -> None:
        """An arm that is hardly moving: its first samples hold for as long as the filters need."""
        for number, one in enumerate(self._filters):
            count = round(SETTLED / self._arm.control_period) * len(forces)
            steady = np.tile(forces[:, number].mean(axis=0), (count, 1))
            _down(one, steady, np.zeros_like(steady))


def _down(one: Any, forces: np.ndarray, turns: np.ndarray) -> Float[np.ndarray, "3"]:
    one.updateBatch(np.ascontiguousarray(turns), np.ascontiguousarray(forces))
    w, x, y, z = one.getQuat6D()
    return -np.array(
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    )
