"""From a command to what a module feels: motors with a lag, a speed limit and ticks; backlash, capstan friction, creep.

The motors chase a held command, so their path within a control step is monotone, and
for monotone paths backlash is a clip. Creep can make the path turn; then backlash is followed
from physics step to physics step. Friction that grows with speed is MuJoCo's: a damper
beside the spring of each cable, which cannot push either.
"""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec, Motor
from s2c2a.arm.geometry import per_cable, per_module

CablePath = Float[np.ndarray, "times modules cables"]


def motor_path(
    position: Float[np.ndarray, "*cables"],
    command: Float[np.ndarray, "*cables"],
    times: np.ndarray,
    motor: Motor,
) -> Float[np.ndarray, "times *cables"]:
    """Positions of motors that chase a held command: exact, so it does not depend on the physics step.

    Args:
        position: where the motors are [m or N].
        command: where they shall go [m or N].
        times: when to say where they are [s], from now.
        motor: lag and speed limit.
    """
    gap = position - command
    size = np.abs(gap)
    later = times.reshape(-1, *[1] * gap.ndim)
    limit = np.inf if motor.speed_limit is None else motor.speed_limit
    lag = motor.time_constant
    # gap from which the lag, not the limit, rules
    slow = np.minimum(size, limit * lag) if lag else np.zeros_like(size)
    fast_time = (size - slow) / limit
    left = np.where(
        later < fast_time,
        size - np.minimum(limit * later, size) if np.isfinite(limit) else 0.0,
        0.0,
    )
    lagging = slow * np.exp(-np.maximum(later - fast_time, 0.0) / lag) if lag else 0.0
    return command + np.sign(gap) * np.where(later < fast_time, left, lagging)


def tick_length(motor: Motor) -> float:
    """Displacement of one encoder tick [m]."""
    return 2 * np.pi * motor.pulley_radius / motor.ticks_per_turn


def encoder_reading(
    position: Float[np.ndarray, "*cables"], motor: Motor, random: np.random.Generator
) -> Float[np.ndarray, "*cables"]:
    """Displacement [m] as the encoders tell it: noise, then whole ticks."""
    tick = tick_length(motor)
    noise = random.normal(scale=motor.noise_ticks, size=position.shape)
    return tick * np.round(position / tick + noise)


class CableTransmission:
    """What is lost between motors and modules of one arm: drift, creep, backlash, friction.

    Attributes:
        transmitted: displacement [m] or tension [N] at the modules, shape (modules,
            cables).
        crept: what the material has got used to [m], shape (modules, cables).
    """

    def __init__(self, arm: ArmSpec, start: np.ndarray, aged: float = 0.0):
        """At rest.

        Args:
            arm: the description.
            start: where the motors are [m or N], shape (modules, cables).
            aged: how far the arm has gone on its way to the drift that its mismatch tell
                of, from 0 to 1.
        """
        names = ("friction", "friction_angle_deg", "stiffness", "creep", "creep_time")
        columns = (per_module(arm, f"cable.{name}")[:, None] for name in names)
        (
            self._friction,
            tube_angle_deg,
            self._stiffness,
            self._creep,
            self._creep_time,
        ) = columns
        self._backlash = per_cable(arm, "cable.backlash")
        self._lost = aged * per_module(arm, "mismatch.drift")[:, None]
        self._tension_driven = arm.actuation == "tension"
        self._tube_angle = np.deg2rad(tube_angle_deg)
        self._neutral = ArmGeometry.of(arm).action_neutral
        self.transmitted = start.copy()
        self.crept = np.zeros_like(start)

    def pass_on(
        self,
        path: CablePath,
        times: np.ndarray,
        tensions: np.ndarray,
        bend_angles: np.ndarray,
    ) -> CablePath:
        """What the modules feel while the motors go along `path`.

        Args:
            path: motor positions [m] or tensions [N] over one control step, shape
                (times, modules, cables), monotone.
            times: of the path [s], from the start of the step.
            tensions: in the cables at the start of the step [N], shape (modules,
                cables).
            bend_angles: of the modules at the start of the step [rad], shape
                (modules,).
        """
        if self._lost.any():
            path = path - self._lost * (path - self._neutral)
        if self._creep.any():
            path = path - self._creep_along(path, times)
        low, high = self._band(path, tensions, bend_angles)
        felt = (
            self._follow(low, high)
            if self._creep.any()
            else np.clip(self.transmitted, low, high)
        )
        self.transmitted = felt[-1]
        return felt

    def at_motors(
        self, tensions: np.ndarray, bend_angles: np.ndarray, winding: np.ndarray
    ) -> np.ndarray:
        """Tensions at the motors of a displacement arm [N]: capstan friction is added where they wind in.

        Args:
            tensions: at the modules [N], shape (modules, cables).
            bend_angles: of the modules [rad], shape (modules,).
            winding: 1 where a motor winds in or did so last, -1 where it pays out, 0
                where it has not moved yet.
        """
        return tensions * np.exp(winding * self._wrap(bend_angles))

    def _creep_along(self, path: CablePath, times: np.ndarray) -> CablePath:
        """Let the material get used to the path, physics step by physics step; returns how far it has."""
        share = 1.0 - np.exp(
            -np.diff(times, prepend=0.0)[:, None, None] / self._creep_time
        )
        crept = np.empty_like(path)
        for step, position in enumerate(path):
            self.crept = self.crept + share[step] * (
                self._creep * position - self.crept
            )
            crept[step] = self.crept
        return crept

    def _follow(self, low: CablePath, high: CablePath) -> CablePath:
        """Stay within a band that moves up and down."""
        felt = np.empty_like(low)
        last = self.transmitted
        for step in range(len(low)):
            last = felt[step] = np.clip(last, low[step], high[step])
        return felt

    def _band(self, path: CablePath, tensions: np.ndarray, bend_angles: np.ndarray):
        """The band around the motors' motion in which the modules' side stays where it is."""
        wrap = self._wrap(bend_angles)
        if self._tension_driven:
            return path * np.exp(-wrap), path * np.exp(wrap)
        width = self._backlash + tensions * np.expm1(wrap) / self._stiffness
        return path - width, path + width

    def _wrap(self, bend_angles: np.ndarray) -> np.ndarray:
        """Friction coefficient times the angle of the tubes: their own, and that of the modules below."""
        return self._friction * (self._tube_angle + _bend_below(bend_angles)[:, None])


def _bend_below(bend_angles: np.ndarray) -> np.ndarray:
    """Sum of the bends of all modules below each one [rad]: their tubes run through those."""
    return np.concatenate([[0.0], np.cumsum(bend_angles)[:-1]])
