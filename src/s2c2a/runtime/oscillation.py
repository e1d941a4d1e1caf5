"""Oscillation monitor: sustained vibration that the goal does not require.

Half-waves of every signal are evaluated as in T. Hägglund, "A control-loop performance
monitor", Control Engineering Practice 3 (1995): a signal oscillates where significant
half-waves follow each other without a pause or decay. The monitor needs no model and no
estimate. It watches the commands and, as angles, what encoders, bend sensors, inertial
sensors and a camera measure, at any control rate: from the slowest mode of a soft arm
to a command that reverses in every step.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.spaces import Actions, Reading

# Chosen: first modes of soft arms are near 1 Hz, and what a user does not see is no
# vibration; `s2c2a reproduce stability` tests them.
MIN_FREQUENCY = 0.3  # Hz; slower motion is no vibration
TREND_TIME = 0.6  # s; time constant of the trend that is subtracted
MIN_AMPLITUDE = np.deg2rad(0.3)  # rad of bend, of a significant half-wave
MIN_SPEED = np.deg2rad(1.5)  # rad/s; its amplitude over its duration
DECAY = 0.5  # of the largest half-wave in the row; a smaller one shows that it decays
GOAL_SHARE = 1.5  # times the goal's own amplitude is not significant
MIN_HALF_WAVES = 4  # in a row
MIN_DURATION = 1.2  # s of significant half-waves in a row, of commands
MIN_SENSED_DURATION = 6.0  # s; an arm that was moved rings and comes to rest by itself
AMPLITUDE_TIME = 1.0  # s; time constant by which stated amplitudes decay

Channels = Float[np.ndarray, " channels"]


@dataclass(frozen=True)
class Vibration:
    """A sustained vibration.

    Attributes:
        signal: name of the signal: `commands` or a sensor.
        module: number of the module.
        amplitude: of its bend [rad].
        frequency: [Hz].
    """

    signal: str
    module: int
    amplitude: float
    frequency: float

    def __str__(self) -> str:
        """Describe the vibration to a user, in deg and Hz."""
        return (
            f"{self.signal} of module {self.module + 1} vibrate at "
            f"{self.frequency:.1f} Hz with {np.rad2deg(self.amplitude):.1f} deg"
        )


class HalfWaves:
    """Half-waves of several signals around their slow trend.

    Attributes:
        amplitudes: recent largest deviations, which decay [rad], shape (channels,).
    """

    def __init__(self, channels: int, period: float):
        """Signals at rest.

        Args:
            channels: number of signals.
            period: between samples [s].
        """
        self._period = period
        self._trend: Channels | None = None
        self._sign = np.zeros(channels)
        self._peak = np.zeros(channels)
        self._duration = np.zeros(channels)
        self._count = np.zeros(channels, int)
        self._sustained = np.zeros(channels)
        self._largest = np.zeros(channels)
        self.amplitudes = np.zeros(channels)

    def update(self, values: Channels, threshold: float) -> None:
        """Take one more sample.

        Args:
            values: of all signals [rad]; values that are not finite repeat the trend.
            threshold: smallest amplitude of a significant half-wave [rad].
        """
        if self._trend is None:
            self._trend = np.where(np.isfinite(values), values, 0.0)
        deviation = np.where(np.isfinite(values), values - self._trend, 0.0)
        share = min(self._period / TREND_TIME, 1.0)
        self._trend = self._trend + share * deviation
        size = np.abs(deviation)
        decay = np.exp(-self._period / AMPLITUDE_TIME)
        self.amplitudes = np.maximum(size, decay * self.amplitudes)
        crossed = np.sign(deviation) != self._sign
        self._end_half_waves(crossed, threshold)
        self._sign = np.where(crossed, np.sign(deviation), self._sign)
        self._peak = np.where(crossed, size, np.maximum(self._peak, size))
        self._duration = np.where(crossed, 0.0, self._duration) + self._period

    def oscillates(self, min_duration: float) -> np.ndarray:
        """Whether each signal oscillates, shape (channels,).

        Args:
            min_duration: of significant half-waves in a row [s].
        """
        is_short = self._duration <= 0.5 / MIN_FREQUENCY
        is_sustained = self._sustained >= min_duration
        return (self._count >= MIN_HALF_WAVES) & is_sustained & is_short

    def frequencies(self) -> Channels:
        """Frequencies of the half-waves in a row [Hz]."""
        return 0.5 * self._count / np.maximum(self._sustained, self._period)

    def _end_half_waves(self, ended: np.ndarray, threshold: float) -> None:
        """Count the half-waves that ended.

        An insignificant one ends the row; one that decays begins a new row.
        """
        duration = np.maximum(self._duration, self._period)
        is_short = duration <= 0.5 / MIN_FREQUENCY
        is_fast = self._peak >= MIN_SPEED * duration
        significant = (self._peak >= threshold) & is_short & is_fast
        continues = significant & (self._peak >= DECAY * self._largest)
        count = continues * self._count + significant
        sustained = continues * self._sustained + significant * duration
        largest = np.maximum(continues * self._largest, significant * self._peak)
        self._count = np.where(ended, count, self._count)
        self._sustained = np.where(ended, sustained, self._sustained)
        self._largest = np.where(ended, largest, self._largest)


class OscillationMonitor:
    """Detects vibration of commands and of sensed motion."""

    def __init__(self, arm: ArmSpec):
        """A monitor of an arm at rest."""
        self._arm = arm
        self._geometry = ArmGeometry.of(arm)
        self.reset()

    def reset(self) -> None:
        """Forget all signals."""
        count = self._arm.module_count
        period = self._arm.control_period
        channels = 2 * count
        self._commands = HalfWaves(channels, period)
        self._sensed: dict[str, HalfWaves] = {}
        self._turned = np.zeros((count, 2))
        self._last_positions = np.full((count, 3), np.nan)
        self._goal = HalfWaves(6 * count, period)

    def update(
        self, command: Actions, reading: Reading, goal: Goal
    ) -> Vibration | None:
        """Take the signals of one control step; return the vibration, if any.

        Args:
            command: desired by the controller [m or N], shape (modules, cables).
            reading: of this step.
            goal: of this step.
        """
        self._goal.update(self._goal_angles(goal), np.inf)
        goal_amplitude = GOAL_SHARE * float(self._goal.amplitudes.max())
        threshold = max(MIN_AMPLITUDE, goal_amplitude)
        self._commands.update(
            self._geometry.commanded_bends(command).reshape(-1), threshold
        )
        found = _vibration("commands", self._commands, MIN_DURATION)
        signals = {
            **self._sensed_bends(reading),
            **self._turned_angles(reading),
            **self._camera_angles(reading),
        }
        for name, angles in signals.items():
            waves = self._sensed.get(name)
            if waves is None:
                waves = HalfWaves(angles.size, self._arm.control_period)
                self._sensed[name] = waves
            waves.update(angles.reshape(-1), threshold)
            each = angles.size // self._arm.module_count
            found = found or _vibration(name, waves, MIN_SENSED_DURATION, each)
        return found

    def _turned_angles(self, reading: Reading) -> dict[str, np.ndarray]:
        """Angles by which the modules' ends turned since the start [rad].

        They drift with the bias of the gyroscopes; only their vibration counts.
        """
        rates = reading.numbers("angular_velocities", (None, self._arm.module_count, 3))
        if rates is None or not len(rates) or not np.isfinite(rates).all():
            return {}
        mean_rates = rates[..., :2].mean(axis=0)
        self._turned = self._turned + self._arm.control_period * mean_rates
        return {"angular_velocities": self._turned}

    def _camera_angles(self, reading: Reading) -> dict[str, np.ndarray]:
        """Last measured positions of the ends [arm lengths], which count as rad."""
        shape = (self._arm.module_count, 3)
        positions = reading.numbers("camera_positions", shape)
        if positions is not None:
            is_measured = np.isfinite(positions)
            self._last_positions = np.where(
                is_measured, positions / self._arm.length, self._last_positions
            )
        if np.isnan(self._last_positions).all():
            return {}
        return {"camera_positions": self._last_positions}

    def _sensed_bends(self, reading: Reading) -> dict[str, np.ndarray]:
        """Bends that encoders and bend sensors measure [rad], by sensor."""
        signals = {}
        modules = self._arm.module_count
        cables = reading.numbers("cables", (modules, self._arm.cable_count))
        if cables is not None:
            angles = cables / self._geometry.cable_radii[:, None]
            signals["cables"] = self._geometry.bends_of(angles).reshape(-1)
        axes = reading.numbers("configurations", (modules, 3))
        if axes is not None:
            signals["configurations"] = axes[:, :2].reshape(-1)
        return signals

    def _goal_angles(self, goal: Goal) -> Channels:
        """Positions [arm lengths] and axes of the goal, which count as rad."""
        positions = goal.desired_positions() / self._arm.length
        return np.concatenate([positions.reshape(-1), goal.desired_axes().reshape(-1)])


def _vibration(
    name: str, waves: HalfWaves, min_duration: float, channels: int = 2
) -> Vibration | None:
    """Return the largest vibration of a group of signals, if any.

    Args:
        name: of the signals.
        waves: their half-waves.
        min_duration: of significant half-waves in a row [s].
        channels: number of signals of each module.
    """
    oscillates = waves.oscillates(min_duration)
    if not oscillates.any():
        return None
    channel = int(np.argmax(np.where(oscillates, waves.amplitudes, -1.0)))
    amplitude = float(waves.amplitudes[channel])
    frequency = float(waves.frequencies()[channel])
    return Vibration(name, channel // channels, amplitude, frequency)
