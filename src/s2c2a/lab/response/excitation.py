"""Excitation of an arm by chirps of all modules, towards x and then towards y."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import PCC, states_from_configurations
from s2c2a.robots import Robot
from s2c2a.runtime import Loop, Player, StepRecord, StepRequest
from s2c2a.spaces import AXIS, Reading, Stage, States

# frequency range of a chirp, in parts of the expected frequency
FIRST_FREQUENCY = 0.2
LAST_FREQUENCY = 2.5
MAX_FREQUENCY = 0.4  # of the control rate
AMPLITUDE = 0.1  # of the bend limits
MAX_TILT = 0.35  # rad; of the tip
LIMIT_SHARE = 0.7  # of the limits of rate and acceleration
CHIRP_PERIODS = 30.0  # of the expected mode
REST_PERIODS = 6.0  # of the expected mode, after a chirp
FADE = 0.03  # of a chirp, at both ends
TIP_SENSORS = ("states", "configurations", "angular_velocities")
"""Sensors that measure the vibration of the tip, best first."""
NO_TIP_SENSOR = (
    "no sensor of this robot shows the vibration of its tip; it provides {}. Add "
    "inertial sensors (`accelerations`, `angular_velocities`) or motion capture "
    "(`states`, `configurations`) at the control rate; encoders and currents are "
    "before the cables' backlash, and cameras are too slow"
)


class Excitation(NamedTuple):
    """Record of both chirps, at every control step.

    Attributes:
        commanded: bends by PCC of the commands that were sent [rad], shape (2, steps,
            modules, 2).
        encoders: bends by PCC of the encoders [rad], the same shape; those of the
            commands where missing.
        measured: tilts of the tip towards x and y [rad], shape (2, steps, 2); NaN if
            missing.
        sensor: name of the sensor that measured them.
    """

    commanded: Float[np.ndarray, "chirps steps modules 2"]
    encoders: Float[np.ndarray, "chirps steps modules 2"]
    measured: Float[np.ndarray, "chirps steps 2"]
    sensor: str

    def tilts(self, direction: int) -> tuple[np.ndarray, np.ndarray]:
        """Commanded and measured tilts in the chirp towards x (0) or y (1) [rad]."""
        commanded = self.commanded[direction, ..., direction].sum(axis=-1)
        return commanded, self.measured[direction, :, direction]


def chirp(
    arm: ArmSpec,
    frequencies: tuple[float, float],
    duration: float,
    amplitudes: Float[np.ndarray, " modules"],
    rate: float,
) -> Float[np.ndarray, "steps modules"]:
    """Bends of an exponential chirp [rad].

    Amplitudes fall where the limits of speed (as 1 / f) and acceleration (as 1 / f^2)
    of the arm require it, so that the arm moves as fast as it may.

    Args:
        arm: limits of its commands.
        frequencies: first and last one [Hz].
        duration: [s].
        amplitudes: largest bends [rad].
        rate: of the commands [Hz].
    """
    geometry = ArmGeometry.of(arm)
    times = np.arange(round(duration * rate)) / rate
    first, last = frequencies
    growth = np.log(last / first) / duration
    omega = 2.0 * np.pi * first * np.exp(growth * times)
    by_speed = geometry.step_limit * arm.control_rate / omega
    by_acceleration = geometry.acceleration_limit * arm.control_rate**2 / omega**2
    allowed = LIMIT_SHARE * np.minimum(by_speed, by_acceleration)
    fade = np.minimum(1.0, np.minimum(times, duration - times) / (FADE * duration))
    wave = fade * np.sin((omega - omega[0]) / growth)
    return wave[:, None] * np.minimum(amplitudes, allowed[:, None])


def chirp_around(arm: ArmSpec, frequency: float) -> Float[np.ndarray, "steps modules"]:
    """Bends of a chirp of all modules around a frequency, followed by rest [rad].

    Args:
        arm: the arm.
        frequency: expected frequency of the first mode [Hz].
    """
    rate = arm.control_rate
    high = min(LAST_FREQUENCY * frequency, MAX_FREQUENCY * rate)
    low = min(FIRST_FREQUENCY * frequency, high / 4.0)
    duration = max(CHIRP_PERIODS / frequency, CHIRP_PERIODS / 3.0 / low)
    amplitudes = AMPLITUDE * ArmGeometry.of(arm).bend_limits
    amplitudes *= min(1.0, MAX_TILT / amplitudes.sum())
    bends = chirp(arm, (low, high), duration, amplitudes, rate)
    rest = np.zeros((round(REST_PERIODS / frequency * rate), arm.module_count))
    return np.concatenate([bends, rest])


def tip_sensor_of(robot: Robot) -> str:
    """The best sensor of a robot for the vibration of its tip.

    Raises:
        S2C2AError: no sensor measures the tip.
    """
    for name in TIP_SENSORS:
        if name in robot.sensors:
            return name
    raise S2C2AError(NO_TIP_SENSOR.format(", ".join(robot.sensors) or "nothing"))


def excite(
    robot: Robot,
    frequency: float,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Excitation:
    """Move a robot through both chirps within its limits, and back to rest.

    Args:
        robot: robot that is not open yet.
        frequency: approximate frequency of its first mode [Hz].
        progress: callback with the numbers of completed and of all control steps.

    Raises:
        S2C2AError: no sensor measures the tip, or readings failed the check; the arm is
            at rest.
    """
    arm = robot.arm
    sensor = tip_sensor_of(robot)
    waves = chirp_around(arm, frequency)
    pcc = PCC.of(arm)
    bends = np.zeros((2, *waves.shape, 2))
    bends[0, ..., 0] = waves
    bends[1, ..., 1] = waves
    flat = jnp.asarray(bends.reshape(-1, arm.module_count, 2), jnp.float32)
    actions = np.asarray(pcc.actions(flat), np.float64)
    required = (sensor,) if robot.sensors[sensor].always else ()
    steps: list[StepRecord] = []
    player = Player(arm, required, actions)
    with Loop(robot, player) as loop:
        for number in range(len(actions)):
            steps.append(loop.tick(StepRequest()))
            if steps[-1].stage is not Stage.RUN:
                seconds = steps[-1].moment - steps[0].moment
                raise S2C2AError(
                    f"the arm was held after {seconds:.1f} s: {loop.fault}"
                )
            progress(number + 1, len(actions))
    records = []
    for chirp_steps in (steps[: len(waves)], steps[len(waves) :]):
        records.append(_chirp_record(chirp_steps, arm, pcc, sensor))
    # late steps make a record longer
    commanded, encoders, measured = (
        np.stack([series[: len(waves)] for series in both])
        for both in zip(*records, strict=True)
    )
    return Excitation(commanded, encoders, measured, sensor)


def _chirp_record(
    steps: list[StepRecord], arm: ArmSpec, pcc: PCC, sensor: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Commanded and encoder bends and measured tilts, one row a control period.

    Periods that the loop skipped repeat the last command, and have no measurement.
    """
    moments = np.array([step.moment for step in steps])
    periods = np.round((moments - moments[0]) / arm.control_period).astype(int)
    periods = np.maximum.accumulate(periods)
    sent = np.array([step.action for step in steps])
    cables = []
    for step, last_sent in zip(steps, np.roll(sent, 1, axis=0), strict=True):
        reading = step.reading.get("cables")
        cables.append(last_sent if reading is None else reading)
    commanded = np.asarray(pcc.bends(np.asarray(sent, np.float32)), float)
    encoders = np.asarray(pcc.bends(np.asarray(cables, np.float32)), float)
    all_periods = np.arange(periods[-1] + 1)
    rows = np.searchsorted(periods, all_periods, side="right") - 1
    measured = np.full((len(rows), 2), np.nan)
    measured[periods] = tip_tilts([step.reading for step in steps], arm, sensor)
    return commanded[rows], encoders[rows], measured


def tip_tilts(
    readings: list[Reading], arm: ArmSpec, sensor: str
) -> Float[np.ndarray, "readings 2"]:
    """Tilts of the tip towards x and y [rad], base frame; NaN if missing."""
    if sensor == "angular_velocities":
        return _integrated_tilts(readings)
    missing = np.full((arm.module_count, 6 if sensor == "states" else 3), np.nan)
    rows = []
    for reading in readings:
        values = reading.get(sensor)
        rows.append(missing if values is None else values)
    values = np.array(rows, float)
    return tilts(values if sensor == "states" else _states(values, arm))


def tilts(states: States) -> Float[np.ndarray, "*batch 2"]:
    """Tilts of the tip [rad]: the angle of its axis to z, times its direction."""
    axis = states[..., -1, AXIS]
    across = np.linalg.norm(axis[..., :2], axis=-1, keepdims=True)
    return axis[..., :2] * np.arctan2(across, axis[..., 2:]) / np.maximum(across, 1e-12)


def _states(configurations: np.ndarray, arm: ArmSpec) -> States:
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
    states = states_from_configurations(
        jnp.asarray(configurations, jnp.float32), lengths
    )
    return np.asarray(states, np.float64)


def _integrated_tilts(readings: list[Reading]) -> Float[np.ndarray, "readings 2"]:
    """Integrated angular velocity of the tip; the gyroscope bias becomes a drift.

    A tilt towards x is a rotation about y, and a tilt towards y one about -x.
    """
    rates = np.full((len(readings), 3), np.nan)
    for row, reading in enumerate(readings):
        samples = reading.get("angular_velocities")
        if samples is not None:
            rates[row] = np.mean(samples[:, -1], axis=0)
    times = np.array([reading.time for reading in readings])
    is_missing = ~np.isfinite(rates).all(axis=-1)
    tilt_rates = np.nan_to_num(rates[:, [1, 0]] * [1.0, -1.0])
    changes = tilt_rates * np.diff(times, prepend=times[0])[:, None]
    return np.where(is_missing[:, None], np.nan, np.cumsum(changes, axis=0))
