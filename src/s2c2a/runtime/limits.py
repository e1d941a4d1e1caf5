"""What a command may be, and how fast it may change, whatever asks for it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import Actions

ROUNDING = 1e-9
TURN = 1.5
"""Acceleration limit of an arm that states none, in step limits: plans of the paper's
recipe turn round so fast."""
PerModule = Float[np.ndarray, "modules 1"]


@dataclass(frozen=True)
class CommandLimits:
    """Limits of value, rate and acceleration of commands, step by step.

    The size of a change is that of the bend that it asks for, or of what the cables
    have in common, if that is more: in parts of the range of a module's actions. Limits
    are counted in control steps, so they hold across any gap in time.

    Attributes:
        geometry: of the arm.
        step: largest change of a module's command in a step, in parts of the range of
            its actions, shape (modules, 1).
        turn: largest change of that change from step to step, the same.
    """

    geometry: ArmGeometry
    step: PerModule
    turn: PerModule

    @classmethod
    def of(cls, arm: ArmSpec) -> "CommandLimits":
        """The arm's own; unless it says otherwise, it reaches its largest rate in one step, and turns round in two."""
        step = arm.step_limit_deg
        return cls.with_steps(arm, step, arm.acceleration_limit_deg or TURN * step)

    @classmethod
    def with_steps(
        cls, arm: ArmSpec, step_deg: float, turn_deg: float
    ) -> "CommandLimits":
        """Others, in bends [deg]."""
        geometry = ArmGeometry.of(arm)
        return cls(
            geometry,
            *(
                np.deg2rad(limit) / geometry.action_bends[:, None]
                for limit in (step_deg, turn_deg)
            ),
        )

    @property
    def rest(self) -> Actions:
        """The command of an arm at rest."""
        return self.geometry.action_neutral

    def limited(
        self, desired: Actions, last: Actions, change: Actions, before: Actions
    ) -> Actions:
        """The command nearest to what is desired that the limits allow, and from which they can go on to be kept.

        What is desired moves, as a plan does, or stands, and is then arrived at without
        going beyond it.

        Args:
            desired: finite or not; what is not finite asks for nothing [m or N], shape
                (modules, cables).
            last: the last command, within its limits.
            change: that it made.
            before: what was desired in the last step, finite or not.
        """
        within = self._in_range(np.where(np.isfinite(desired), desired, last))
        way = within - last
        moved = within - np.where(np.isfinite(before), before, within)
        behind = way - moved
        size, turn, left = self.sizes(np.stack([way, way - change, behind]))
        free = (
            (size <= self.step)
            & (np.maximum(turn, left) <= self.turn)
            & self._stops_within(way, last)
        )
        if free.all():
            return within
        caught_up = moved + self._shortened(behind, self._stoppable(left))
        return np.where(
            free,
            within,
            self._changed(self._shortened(caught_up, self.step), last, change),
        )

    def towards_rest(self, last: Actions, change: Actions) -> Actions:
        """One gentle step of every cable towards rest, all modules arriving together."""
        way = self.rest - last
        size = np.maximum(self.sizes(way), ROUNDING)
        left = float((size / np.minimum(self.step, self._stoppable(size))).max())
        return self._changed(way / max(left, 1.0), last, change)

    def sizes(self, way: Actions) -> Float[np.ndarray, "*batch modules 1"]:
        """Sizes of changes, in parts of the range of actions, shape (*batch, modules, 1)."""
        parts = way * self._shares
        bends = (self.geometry.bend_matrices @ parts[..., None])[..., 0]
        squared = np.maximum(
            (bends**2).sum(axis=-1, keepdims=True),
            (parts**2).max(axis=-1, keepdims=True),
        )
        return np.sqrt(squared)

    @cached_property
    def _shares(self) -> PerModule:
        return 1.0 / np.abs(self.geometry.action_scale)[:, None]

    def _stoppable(self, distance: PerModule) -> PerModule:
        """The largest change from which braking, step by step, ends after a distance and not beyond."""
        steps = np.floor((np.sqrt(1.0 + 8.0 * distance / self.turn) - 1.0) / 2.0)
        return distance / (steps + 1.0) + 0.5 * self.turn * steps

    def _stops_within(
        self, move: Actions, last: Actions
    ) -> Bool[np.ndarray, "modules 1"]:
        """Whether a change leaves the room to brake before a limit of value."""
        size = np.maximum(self.sizes(move), ROUNDING)
        steps = np.floor(size / self.turn)
        stop = last + move * (steps + 1.0) * (1.0 - 0.5 * self.turn * steps / size)
        room = ROUNDING / np.abs(self._shares)
        inside = (stop >= self.geometry.action_low - room) & (
            stop <= self.geometry.action_high + room
        )
        return inside.all(axis=-1, keepdims=True)

    def _changed(self, move: Actions, last: Actions, change: Actions) -> Actions:
        """The command after a change as near to a desired one as acceleration allows; else it brakes."""
        turned = change + self._shortened(move - change, self.turn)
        braked = change - self._shortened(change, self.turn)
        return self._in_range(
            last + np.where(self._stops_within(turned, last), turned, braked)
        )

    def _in_range(self, command: Actions) -> Actions:
        return np.clip(command, self.geometry.action_low, self.geometry.action_high)

    def _shortened(self, way: Actions, longest: PerModule) -> Actions:
        return way * np.minimum(1.0, longest / np.maximum(self.sizes(way), ROUNDING))
