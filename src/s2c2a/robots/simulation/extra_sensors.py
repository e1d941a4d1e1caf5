"""Simulated sensors other than encoders, with the errors of real ones."""

from collections import deque

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, Motor
from s2c2a.arm.geometry import interpolated
from s2c2a.arm.sensors import Camera, Inertial
from s2c2a.robots.simulation.flex import FlexStrips
from s2c2a.robots.simulation.random_streams import Stream, random_stream
from s2c2a.spaces import POSITION, Sensor, States


def declare_extra_sensors(arm: ArmSpec) -> dict[str, Sensor]:
    """Declare the sensors of the arm's table `[sensors]`."""
    declared: dict[str, Sensor] = {}
    modules = arm.module_count
    if arm.sensors.imu is not None:
        shape = (samples_per_step(arm, arm.sensors.imu), modules, 3)
        declared["accelerations"] = Sensor(shape, "m/s2")
        declared["angular_velocities"] = Sensor(shape, "rad/s")
    if arm.sensors.camera is not None:
        declared["camera_positions"] = Sensor((modules, 3), "m", always=False)
        declared["camera_age"] = Sensor((), "s", always=False)
    if arm.sensors.flex is not None:
        strips = len(arm.sensors.flex.angles_deg)
        declared["flex"] = Sensor((modules, strips), "rad")
    return declared


def samples_per_step(arm: ArmSpec, inertial: Inertial) -> int:
    """Return the number of inertial samples in a control step."""
    return max(1, round(inertial.rate * arm.control_period))


class InertialSensors:
    """Accelerometers and gyroscopes at the ends of the modules, in the frames there."""

    def __init__(self, arm: ArmSpec, inertial: Inertial, seed: int, opening: int):
        """Sample new biases for every opening."""
        self._count = samples_per_step(arm, inertial)
        self._modules = arm.module_count
        self._random = random_stream(seed, Stream.INERTIAL, opening)
        turn_noise = np.deg2rad(inertial.turn_noise_deg)
        turn_bias = np.deg2rad(inertial.turn_bias_deg)
        repeats = 3 * self._modules
        self._noise = np.repeat([inertial.acceleration_noise, turn_noise], repeats)
        self._bias = self._random.normal(
            scale=np.repeat([inertial.acceleration_bias, turn_bias], repeats)
        )
        self._samples: Float[np.ndarray, "samples n"] | None = None

    def sample(self, values: Float[np.ndarray, "times n"]) -> None:
        """Sample from the true values at every physics step since the last reading.

        Args:
            values: accelerations of all modules, then angular velocities of all.
        """
        steps = np.linspace(0, len(values) - 1, self._count + 1).round().astype(int)
        noise = self._random.normal(size=(self._count, len(self._bias)))
        self._samples = values[steps[1:]] + self._bias + self._noise * noise

    def read(self) -> dict[str, np.ndarray]:
        """Return the samples; empty before the arm has moved."""
        if self._samples is None:
            return {}
        samples = self._samples.reshape(self._count, 2, self._modules, 3)
        return {"accelerations": samples[:, 0], "angular_velocities": samples[:, 1]}


class CameraView:
    """Positions of module ends in camera images, with a delay and lost images."""

    def __init__(self, arm: ArmSpec, camera: Camera, seed: int, opening: int):
        """Sample new lost images for every opening."""
        self._camera = camera
        self._period = arm.control_period
        self._stream = (seed, Stream.CAMERA, opening)
        # an image was exposed up to one control period before its delay began
        steps = int(camera.delay * arm.control_rate) + 3
        self._history: deque[tuple[float, States]] = deque(maxlen=steps)

    def start(self, states: States) -> None:
        """Forget earlier states; the arm rests, and the clock is at zero."""
        self._history.clear()
        self.observe(0.0, states)

    def observe(self, time: float, states: States) -> None:
        """Record the true states at `time` [s]."""
        self._history.append((time, states))

    def read(self, time: float) -> dict[str, np.ndarray]:
        """Return the image that arrived since the last control step, if any."""
        camera = self._camera
        number = np.floor((time - camera.delay) * camera.rate + 1e-9)
        exposure = number / camera.rate  # s
        is_new = exposure + camera.delay > time - self._period + 1e-9
        random = random_stream(*self._stream, max(int(number), 0))
        if number < 0 or not is_new or random.random() < camera.lost:
            return {}
        times, states = zip(*self._history, strict=True)
        seen = np.array(states)[..., POSITION]
        positions = interpolated(exposure, np.array(times), seen)
        positions += random.normal(scale=camera.noise, size=positions.shape)
        if camera.sees == "tip":
            positions[:-1] = np.nan
        return {
            "camera_positions": positions,
            "camera_age": np.asarray(time - exposure),
        }


class MotorCurrents:
    """Tensions estimated from motor currents, with gear friction and noise.

    Attributes:
        winding: direction of the last motion of every motor: 1 winds the cable in, -1
            pays it out, 0 before the first motion; shape (modules, cables).
    """

    def __init__(self, motor: Motor, positions: np.ndarray, inward: float):
        """Begin with motors at rest.

        Args:
            motor: the description.
            positions: of the motors, shape (modules, cables).
            inward: sign of a motion that winds a cable in.
        """
        self._motor = motor
        self._positions = positions
        self._inward = inward
        self.winding = np.zeros_like(positions)

    def move(self, positions: np.ndarray) -> None:
        """Update the direction of motion with the positions at the end of a step."""
        direction = np.sign(positions - self._positions) * self._inward
        self.winding = np.where(direction == 0, self.winding, direction)
        self._positions = positions

    def read(
        self, tensions: np.ndarray, noise: float, random: np.random.Generator
    ) -> np.ndarray:
        """Return the measured tensions at the motors [N]."""
        gear_friction = self.winding * self._motor.current_friction
        errors = random.normal(scale=noise, size=tensions.shape)
        return tensions + gear_friction + errors


class ExtraSensors:
    """All sensors of the table `[sensors]` of one arm."""

    def __init__(self, arm: ArmSpec, seed: int, opening: int):
        """Create the sensors of the arm; their biases differ at every opening."""
        imu, camera, flex = arm.sensors.imu, arm.sensors.camera, arm.sensors.flex
        self._inertial = InertialSensors(arm, imu, seed, opening) if imu else None
        self._camera = CameraView(arm, camera, seed, opening) if camera else None
        self._flex = FlexStrips(arm, flex, seed, opening) if flex else None

    def start(self, states: States) -> None:
        """Begin a run: the arm rests, and the clock is at zero."""
        if self._camera is not None:
            self._camera.start(states)

    def sample_inertial(self, values: Float[np.ndarray, "times n"]) -> None:
        """Sample the inertial sensors; see `InertialSensors.sample`."""
        if self._inertial is not None:
            self._inertial.sample(values)

    def observe(self, time: float, seconds: float, states: States) -> None:
        """Record the true states at `time`, `seconds` after the last call."""
        if self._camera is not None:
            self._camera.observe(time, states)
        if self._flex is not None:
            self._flex.bend(states, seconds)

    def read(self, time: float) -> dict[str, np.ndarray]:
        """Return the values of all sensors at `time` [s]."""
        values: dict[str, np.ndarray] = {}
        if self._inertial is not None:
            values |= self._inertial.read()
        if self._camera is not None:
            values |= self._camera.read(time)
        if self._flex is not None:
            values |= self._flex.read()
        return values
