"""What the simulated arm sensors beside its motors, with the faults of real parts."""

from collections import deque

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, Motor
from s2c2a.arm.sensors import Camera, Inertial
from s2c2a.robots.simulation.flex import FlexStrips
from s2c2a.spaces import POSITION, Sensor, States

LONGEST = 2.0  # s; what a camera may be behind
# streams of random numbers
_INERTIAL = 3
_CAMERA = 4


def sensed_beside(arm: ArmSpec) -> dict[str, Sensor]:
    """What readings hold of it, by the arm's description."""
    said: dict[str, Sensor] = {}
    modules = arm.module_count
    if (inertial := arm.sensors.imu) is not None:
        shape = (samples(arm, inertial), modules, 3)
        said |= {
            "accelerations": Sensor(shape, "m/s2"),
            "angular_velocities": Sensor(shape, "rad/s"),
        }
    if arm.sensors.camera is not None:
        said |= {
            "camera_positions": Sensor((modules, 3), "m", always=False),
            "camera_age": Sensor((), "s", always=False),
        }
    if arm.sensors.flex is not None:
        said["flex"] = Sensor((modules, len(arm.sensors.flex.angles_deg)), "rad")
    return said


def samples(arm: ArmSpec, inertial: Inertial) -> int:
    """Of inertial sensors in a control step."""
    return max(1, round(inertial.rate * arm.control_period))


class InertialSensors:
    """One at the end of every module: what it accelerates by, gravity included, and how it turns, in its own frame."""

    def __init__(self, arm: ArmSpec, part: Inertial, seed: int, opening: int):
        """Anew at every opening: their zeros differ."""
        self._count = samples(arm, part)
        self._modules = arm.module_count
        self._random = np.random.default_rng([seed, _INERTIAL, opening])
        turns = np.deg2rad([part.turn_noise_deg, part.turn_bias_deg])
        self._noise = np.repeat([part.acceleration_noise, turns[0]], 3 * self._modules)
        self._bias = self._random.normal(
            scale=np.repeat([part.acceleration_bias, turns[1]], 3 * self._modules)
        )
        self._felt: Float[np.ndarray, "samples numbers"] | None = None

    def feel(self, moments: Float[np.ndarray, "moments numbers"]) -> None:
        """What is felt at every physics step since the last reading: accelerations of all, then turn rates of all."""
        chosen = (
            np.linspace(0, len(moments) - 1, self._count + 1).round().astype(int)[1:]
        )
        self._felt = (
            moments[chosen]
            + self._bias
            + self._noise * self._random.normal(size=(self._count, len(self._bias)))
        )

    def read(self) -> dict[str, np.ndarray]:
        """In a reading; nothing before the arm has moved."""
        if self._felt is None:
            return {}
        both = self._felt.reshape(self._count, 2, self._modules, 3)
        return {"accelerations": both[:, 0], "angular_velocities": both[:, 1]}


class CameraView:
    """Where a camera saw ends of modules: at its own rate, late, and not always."""

    def __init__(self, arm: ArmSpec, part: Camera, seed: int, opening: int):
        """Anew at every opening: other pictures are lost."""
        self._part = part
        self._period = arm.control_period
        self._stream = (seed, _CAMERA, opening)
        self._past: deque[tuple[float, States]] = deque(
            maxlen=round(LONGEST * arm.control_rate) + 2
        )

    def begin(self, states: States) -> None:
        """The arm rests, and the clock is at zero."""
        self._past.clear()
        self.look(0.0, states)

    def look(self, time: float, states: States) -> None:
        """Where the arm is now."""
        self._past.append((time, states))

    def read(self, time: float) -> dict[str, np.ndarray]:
        """The picture that arrived since the last control step, if one did; each with its age."""
        part = self._part
        number = np.floor((time - part.delay) * part.rate + 1e-9)
        taken = number / part.rate
        new = taken + part.delay > time - self._period + 1e-9
        random = np.random.default_rng([*self._stream, max(int(number), 0)])
        if number < 0 or not new or random.random() < part.lost:
            return {}
        positions = self._at(taken)
        positions += random.normal(scale=part.noise, size=positions.shape)
        if part.sees == "tip":
            positions[:-1] = np.nan
        return {"camera_positions": positions, "camera_age": np.asarray(time - taken)}

    def _at(self, time: float) -> Float[np.ndarray, "modules 3"]:
        times, states = zip(*self._past, strict=True)
        positions = np.array(states)[..., POSITION].reshape(len(times), -1)
        return np.array([np.interp(time, times, row) for row in positions.T]).reshape(
            -1, 3
        )


class Currents:
    """What motors' currents tell of tensions: with friction in their gears, and noise."""

    def __init__(self, motor: Motor, motors: np.ndarray, inward: float):
        """Of motors that stand.

        Args:
            motor: the description.
            motors: where they are, shape (modules, cables).
            inward: sign of a motion that winds a cable up.
        """
        self._motor = motor
        self._at = motors
        self._inward = inward
        self.winding = np.zeros_like(motors)

    def move(self, motors: np.ndarray) -> None:
        """Motors are there at the end of a step; which way they went is kept while they stand."""
        way = np.sign(motors - self._at) * self._inward
        self.winding = np.where(way == 0, self.winding, way)
        self._at = motors

    def read(
        self, tensions: np.ndarray, noise: float, random: np.random.Generator
    ) -> np.ndarray:
        """Tensions at the motors [N] as the currents tell them."""
        gears = self.winding * self._motor.current_friction
        return tensions + gears + random.normal(scale=noise, size=tensions.shape)


class Beside:
    """All of them, of one arm."""

    def __init__(self, arm: ArmSpec, seed: int, opening: int):
        """Anew at every opening."""
        sensors = arm.sensors
        drawn = (seed, opening)
        self._inertial = (
            None if sensors.imu is None else InertialSensors(arm, sensors.imu, *drawn)
        )
        self._camera = (
            None if sensors.camera is None else CameraView(arm, sensors.camera, *drawn)
        )
        self._flex = (
            None if sensors.flex is None else FlexStrips(arm, sensors.flex, *drawn)
        )

    def begin(self, states: States) -> None:
        """The arm rests, and the clock is at zero."""
        if self._camera is not None:
            self._camera.begin(states)

    def feel(self, moments: Float[np.ndarray, "moments numbers"]) -> None:
        """What inertial sensors feel at every physics step since the last reading."""
        if self._inertial is not None:
            self._inertial.feel(moments)

    def look(self, time: float, seconds: float, states: States) -> None:
        """Where the arm is now, so many seconds after the last time."""
        if self._camera is not None:
            self._camera.look(time, states)
        if self._flex is not None:
            self._flex.bend(states, seconds)

    def read(self, time: float) -> dict[str, np.ndarray]:
        """In a reading."""
        inertial = {} if self._inertial is None else self._inertial.read()
        camera = {} if self._camera is None else self._camera.read(time)
        return (
            inertial | camera | ({} if self._flex is None else self._flex.read())
        )
