"""Motors and cable transmission: lag, rate limit, backlash, capstan friction, creep.

Motors approach a constant command, so their path within a control step is monotone,
and for monotone paths backlash is a clip. Creep can reverse the path; with it, backlash
is computed in every physics step. Viscous friction is a damper beside the spring of
each cable in MuJoCo.
"""

from collections.abc import Sequence
from copy import copy

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec, Motor
from s2c2a.arm.backlash import play, play_along
from s2c2a.arm.geometry import cables_present, per_cable, per_module

Cables = Float[np.ndarray, "*arms modules cables"]
AnyCables = Float[np.ndarray, "*cables"]
CablePath = Float[np.ndarray, "times *arms modules cables"]


def compute_motor_path(
    position: AnyCables, command: AnyCables, times: np.ndarray, motor: Motor
) -> Float[np.ndarray, "times *cables"]:
    """Solve the motion of motors towards a constant command exactly.

    A motor moves at its speed limit until its first-order lag is slower. The solution
    is exact and does not depend on the physics step.

    Args:
        position: current positions [m or N].
        command: commanded positions [m or N].
        times: times of the path [s], from now.
        motor: lag and speed limit.
    """
    error = position - command
    distance = np.abs(error)
    times = times.reshape(-1, *[1] * error.ndim)
    speed = np.inf if motor.speed_limit is None else motor.speed_limit
    lag = motor.time_constant
    # Distance below which the lag is slower than the speed limit.
    lag_distance = np.minimum(distance, speed * lag) if lag else np.zeros_like(distance)
    limited_time = (distance - lag_distance) / speed
    limited = np.zeros_like(distance)
    if np.isfinite(speed):
        limited = distance - np.minimum(speed * times, distance)
    lagging = 0.0
    if lag:
        decay = np.exp(-np.maximum(times - limited_time, 0.0) / lag)
        lagging = lag_distance * decay
    remaining = np.where(times < limited_time, limited, lagging)
    return command + np.sign(error) * remaining


def measurement_noise(arm: ArmSpec) -> float:
    """Standard deviation of measured cables, in ticks [1], N or Pa (`read_cables`)."""
    if arm.actuation == "displacement":
        return arm.motor.noise_ticks
    return arm.motor.measurement_noise(arm.actuation)


def read_cables(arm: ArmSpec, motors: Cables, noise: Cables) -> Cables:
    """Return measured displacements [m], tensions [N] or pressures [Pa].

    Args:
        arm: the description.
        motors: their positions, in the same unit.
        noise: of `measurement_noise`.
    """
    present = cables_present(arm)
    if arm.actuation == "displacement":
        return present * read_encoders(motors, arm.motor, noise)
    return motors + present * noise


def read_encoders(position: AnyCables, motor: Motor, noise: AnyCables) -> AnyCables:
    """Return measured displacements [m]: noise [ticks] is added, whole ticks remain."""
    tick = motor.tick_length
    return tick * np.round(position / tick + noise)


class CableTransmission:
    """Losses between the motors and the modules of one arm, or of several (`stack`).

    The losses are drift, creep, backlash and capstan friction.

    Attributes:
        transmitted: displacement [m] or tension [N] at the modules, shape (*arms,
            modules, cables).
        crept: displacement lost to creep [m], likewise.
    """

    def __init__(self, arm: ArmSpec, start: np.ndarray, aged: float = 0.0):
        """Begin at rest.

        Args:
            arm: the description.
            start: positions of the motors [m or N], shape (modules, cables).
            aged: share of the drift in the arm's mismatch that has developed, 0 to 1.
        """
        tube_angle_deg = per_module(arm, "cable.friction_angle_deg")[:, None]
        self._tube_angle = np.deg2rad(tube_angle_deg)
        self._friction = per_module(arm, "cable.friction")[:, None]
        self._stiffness = per_module(arm, "cable.stiffness")[:, None]
        self._creep = per_module(arm, "cable.creep")[:, None]
        self._creep_time = per_module(arm, "cable.creep_time")[:, None]
        self._backlash = per_cable(arm, "cable.backlash")
        self._drift = aged * per_module(arm, "mismatch.drift")[:, None]
        self._tension_driven = arm.actuation == "tension"
        self._neutral = ArmGeometry.of(arm).action_neutral
        self.transmitted = start.copy()
        self.crept = np.zeros_like(start)

    @classmethod
    def stack(cls, arms: Sequence["CableTransmission"]) -> "CableTransmission":
        """Return the losses of several arms of one actuation, which come first."""
        stacked = copy(arms[0])
        for name, value in vars(arms[0]).items():
            if isinstance(value, np.ndarray):
                values = [getattr(arm, name) for arm in arms]
                setattr(stacked, name, np.stack(values))
        return stacked

    @property
    def has_friction(self) -> bool:
        """Whether tensions or bend angles influence what is transmitted."""
        return bool(self._friction.any())

    def transmit(
        self,
        path: CablePath,
        times: np.ndarray,
        tensions: np.ndarray,
        bend_angles: np.ndarray,
    ) -> CablePath:
        """Return the path at the modules for a path of the motors.

        Args:
            path: motor positions [m] or tensions [N] over one control step, shape
                (times, *arms, modules, cables), monotone.
            times: times of the path [s], from the start of the step.
            tensions: in the cables at the start of the step [N], shape (*arms,
                modules, cables).
            bend_angles: of the modules at the start of the step [rad], shape (*arms,
                modules).
        """
        if self._drift.any():
            path = path - self._drift * (path - self._neutral)
        creeps = self._creep.any()
        if creeps:
            durations = np.diff(times, prepend=0.0).reshape(-1, *[1] * (path.ndim - 1))
            shares = 1.0 - np.exp(-durations / self._creep_time)
            creep_path = np.empty_like(path)
            for step, position in enumerate(path):
                target = self._creep * position
                self.crept = self.crept + shares[step] * (target - self.crept)
                creep_path[step] = self.crept
            path = path - creep_path
        # the band around the motors' path in which the modules' side sticks
        exponent = self._friction_exponent(bend_angles)
        if self._tension_driven:
            low, high = path * np.exp(-exponent), path * np.exp(exponent)
        else:
            width = self._backlash + tensions * np.expm1(exponent) / self._stiffness
            low, high = path - width, path + width
        follow = play_along if creeps else play
        transmitted = follow(self.transmitted, low, high)
        self.transmitted = transmitted[-1]
        return transmitted

    def motor_tensions(
        self, tensions: np.ndarray, bend_angles: np.ndarray, winding: np.ndarray
    ) -> np.ndarray:
        """Return the tensions at the motors of a displacement arm [N].

        Capstan friction raises them where a motor winds in and lowers them where it
        pays out.

        Args:
            tensions: at the modules [N], shape (modules, cables).
            bend_angles: of the modules [rad], shape (modules,).
            winding: last direction of every motor: 1 wound in, -1 paid out, 0 did not
                move yet.
        """
        return tensions * np.exp(winding * self._friction_exponent(bend_angles))

    def _friction_exponent(self, bend_angles: np.ndarray) -> np.ndarray:
        """Return friction coefficient times wrap angle.

        The wrap angle is that of the tube plus the bends of all modules below, which
        the tube runs through.
        """
        bends_below = np.zeros_like(bend_angles)
        bends_below[..., 1:] = np.cumsum(bend_angles, axis=-1)[..., :-1]
        return self._friction * (self._tube_angle + bends_below[..., None])
