"""Limits of commands in value, rate, and acceleration: the last filter before a robot.

This is the definition for commands. Every command passes it, whatever the source.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.plugins.immutable import immutable
from s2c2a.spaces import Actions

ROUNDING = 1e-9  # of the action range; avoids divisions by zero
EQUAL = 1e-6  # of the full bend; commands that differ by less are the same
PerModule = Float[np.ndarray, "modules 1"]


@dataclass(frozen=True)
class CommandLimits:
    """Limits of value, rate, and acceleration of commands, per control step.

    The size of a change is the bend that it commands, or the largest change of one
    cable if that is more, as a fraction of the module's action range. Limits count
    control steps, not seconds, so that no gap in time permits a jump. They also run in
    JAX, in exported code.

    Attributes:
        geometry: arrays of the arm.
        step_limit: largest change of a module's command in one step, as a fraction of
            the module's action range, shape (modules, 1).
        acceleration_limit: largest difference of two successive changes, likewise.
    """

    geometry: ArmGeometry
    step_limit: PerModule
    acceleration_limit: PerModule

    @classmethod
    def of(cls, arm: ArmSpec) -> "CommandLimits":
        """Limits of an arm file.

        Without `acceleration_limit_deg`, the arm reaches its largest rate in one step
        and reverses in two.
        """
        geometry = ArmGeometry.of(arm)
        ranges = geometry.action_bends[:, None]
        acceleration = geometry.acceleration_limit / ranges
        return cls(geometry, geometry.step_limit / ranges, acceleration)

    @property
    def rest(self) -> Actions:
        """Command of an arm at rest [m or N], shape (modules, cables)."""
        return self.geometry.action_neutral

    def limited(
        self, desired: Actions, last: Actions, change: Actions, before: Actions
    ) -> Actions:
        """Return the allowed command nearest to the desired one.

        From the returned command the arm can still brake before a limit of value. A
        desired command that moves is followed; a constant one is reached without
        overshoot.

        Args:
            desired: desired command [m or N], shape (modules, cables); a value that is
                not finite requests no change.
            last: last command, within its limits.
            change: change that the last command made.
            before: desired command of the last step, finite or not.
        """
        xp = desired.__array_namespace__()
        target = self._in_range(xp.where(xp.isfinite(desired), desired, last))
        displacement = target - last
        # a desired command beyond the range does not move while it stays there
        last_target = self._in_range(xp.where(xp.isfinite(before), before, target))
        target_change = target - last_target
        lag = displacement - target_change
        size, acceleration, lag_size = self.change_sizes(
            xp.stack([displacement, displacement - change, lag])
        )
        allowed = (
            (size <= self.step_limit)
            & (xp.maximum(acceleration, lag_size) <= self.acceleration_limit)
            & self._stops_in_range(displacement, last)
        )
        # the usual case; a traced step cannot branch
        if isinstance(allowed, np.ndarray) and allowed.all():
            return target
        catch_up = target_change + self._capped(lag, self._stoppable_change(lag_size))
        feasible = self._accelerated(
            self._capped(catch_up, self.step_limit), last, change
        )
        return xp.where(allowed, target, feasible)

    def towards_rest(self, last: Actions, change: Actions) -> Actions:
        """Return the next command on the way to rest; all modules arrive together."""
        displacement = self.rest - last
        size = np.maximum(self.change_sizes(displacement), ROUNDING)
        largest_change = np.minimum(self.step_limit, self._stoppable_change(size))
        steps = float((size / largest_change).max())
        return self._accelerated(displacement / max(steps, 1.0), last, change)

    def change_sizes(self, change: Actions) -> Float[np.ndarray, "*batch modules 1"]:
        """Return sizes of changes as fractions of the action range of each module."""
        parts = change * self._inverse_scales
        bends = self.geometry.bends_of(parts)
        squared_bends = (bends**2).sum(axis=-1, keepdims=True)
        alone = parts / self._common_share
        squared_cables = (alone**2).max(axis=-1, keepdims=True)
        xp = change.__array_namespace__()
        return xp.sqrt(xp.maximum(squared_bends, squared_cables))

    @cached_property
    def _common_share(self) -> PerModule | float:
        """How much more pressures change by their common part than without it."""
        balance = self.geometry.balance
        if balance is None:
            return 1.0
        least = np.where(balance > 0.0, balance, np.inf).min(axis=-1, keepdims=True)
        return 1.0 + balance.max(axis=-1, keepdims=True) / least

    @cached_property
    def _inverse_scales(self) -> PerModule:
        return 1.0 / np.abs(self.geometry.action_scale)[:, None]

    def _stoppable_change(self, distance: PerModule) -> PerModule:
        """Largest change from which braking at the limit covers just a distance."""
        xp = distance.__array_namespace__()
        limit = self.acceleration_limit
        steps = xp.floor((xp.sqrt(1.0 + 8.0 * distance / limit) - 1.0) / 2.0)
        return distance / (steps + 1.0) + 0.5 * limit * steps

    def _stops_in_range(
        self, change: Actions, last: Actions
    ) -> Bool[np.ndarray, "modules 1"]:
        """Whether the arm can brake after a change before a limit of value."""
        xp = change.__array_namespace__()
        size = xp.maximum(self.change_sizes(change), ROUNDING)
        steps = xp.floor(size / self.acceleration_limit)
        lost = 0.5 * self.acceleration_limit * steps / size  # share lost by braking
        stop = last + change * (steps + 1.0) * (1.0 - lost)
        tolerance = ROUNDING / np.abs(self._inverse_scales)
        above_low = stop >= self.geometry.action_low - tolerance
        below_high = stop <= self.geometry.action_high + tolerance
        return (above_low & below_high).all(axis=-1, keepdims=True)

    def _accelerated(self, desired: Actions, last: Actions, change: Actions) -> Actions:
        """Command after the change nearest to a desired one; it brakes if need be."""
        limit = self.acceleration_limit
        faster = change + self._capped(desired - change, limit)
        braking = change - self._capped(change, limit)
        safe = self._stops_in_range(faster, last)
        xp = change.__array_namespace__()
        return self._in_range(last + xp.where(safe, faster, braking))

    def _in_range(self, command: Actions) -> Actions:
        return command.__array_namespace__().clip(
            command, self.geometry.action_low, self.geometry.action_high
        )

    def _capped(self, change: Actions, max_size: PerModule) -> Actions:
        """Shorten a change to a largest size, in the same direction."""
        xp = change.__array_namespace__()
        size = xp.maximum(self.change_sizes(change), ROUNDING)
        return change * xp.minimum(1.0, max_size / size)


def command_range(arm: ArmSpec) -> tuple[Actions, Actions]:
    """Return the least and largest commands [m or N] that an arm takes.

    They are those of its cables, or of its servos if that is less.
    """
    geometry = ArmGeometry.of(arm)
    limit = arm.servos.limits.displacement if arm.servos is not None else None
    if limit is None:
        return geometry.action_low, geometry.action_high
    return (
        np.maximum(geometry.action_low, -limit),
        np.minimum(geometry.action_high, limit),
    )


def arm_at(arm: ArmSpec, rate: float) -> ArmSpec:
    """Return an arm that is controlled at another rate [Hz].

    Its limits count control steps; speed and acceleration stay the same.
    """
    geometry = ArmGeometry.of(arm)
    ratio = arm.control_rate / rate
    update = {
        "control_rate": rate,
        "step_limit_deg": float(np.rad2deg(geometry.step_limit)) * ratio,
        "acceleration_limit_deg": float(np.rad2deg(geometry.acceleration_limit))
        * ratio**2,
    }
    return arm.model_copy(update=update)


class CommandLimiter:
    """Applies `CommandLimits` to successive commands, beginning at rest.

    Attributes:
        command: last command [m or N], shape (modules, cables); nothing can change it.
    """

    def __init__(self, limits: CommandLimits):
        """A limiter whose last command is rest."""
        self._limits = limits
        self.command = immutable(limits.rest)
        self._change = np.zeros_like(self.command)
        self._desired = self.command
        self._before = self.command

    @property
    def last_change(self) -> float:
        """Size of the last change, as a fraction of the action range."""
        return float(self._limits.change_sizes(self._change).max())

    @property
    def at_rest(self) -> bool:
        """Whether the last command is the neutral one."""
        displacement = self.command - self._limits.rest
        return bool(self._limits.change_sizes(displacement).max() < EQUAL)

    def hold(self) -> Actions:
        """Return the last command; an earlier plan no longer counts as moving."""
        self._desired = self.command
        return self.command

    def towards_rest(self) -> Actions:
        """Return the next command on the way to rest, before it is limited."""
        self._desired = self.command
        return self._limits.towards_rest(self.command, self._change)

    def limit(self, desired: Actions) -> Actions:
        """Limit a desired command and remember the result as the last command."""
        limited = self._limits.limited(
            desired, self.command, self._change, self._desired
        )
        command = immutable(limited)
        self._change = command - self.command
        self._before = self.command
        self.command = command
        # a controller may use its buffer again
        self._desired = immutable(np.asarray(desired))
        return command

    def not_sent(self) -> None:
        """Return to the command before: the robot did not take the last one."""
        self.command = self._before
        self._change = np.zeros_like(self.command)
        self._desired = self.command

    def changed(self, desired: Actions) -> bool:
        """Whether the last command differs from the desired one."""
        difference = self._limits.change_sizes(self.command - desired).max()
        return not difference <= EQUAL  # also where the desired one is not finite
