"""States of modules from tracked bodies."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, Tracking
from s2c2a.lab.tracking.poses import Pose, TrackingError
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker
from s2c2a.spaces import AXIS, POSITION

FIRST_POSES = 5.0  # s in which the first poses must come
POLL_PERIOD = 0.02  # s


@dataclass(frozen=True, eq=False)
class ModuleEnds:
    """Assignment of tracked bodies to the base and the module ends of an arm.

    With the tracked poses `T_world_base` and `T_world_end`, and the fixed offsets, the
    pose of a module end in the arm's base frame is
    `inverse(T_world_base @ T_base_arm) @ T_world_end @ T_end_module`.

    Attributes:
        ends: body at the end of each module, from the base; empty where none is
            tracked.
        base: body at the base of the arm; None if the source's world frame stands for
            it.
        base_offset: `T_base_arm`, pose of the arm's base frame in the frame of the
            base body.
        end_offsets: `T_end_module` by name of the body, pose of the module's end frame
            in the frame of the body; the identity where absent.

    Raises:
        TrackingError: a body occurs twice, or an offset is of an unknown body.
    """

    ends: tuple[str, ...]
    base: str | None = "base"
    base_offset: Pose = field(default_factory=Pose.identity)
    end_offsets: Mapping[str, Pose] = field(default_factory=dict)

    def __post_init__(self):
        names = self.bodies
        repeated = sorted({name for name in names if names.count(name) > 1})
        if not any(self.ends) or repeated:
            raise TrackingError(
                f"bodies of the ends are {list(self.ends)}, of the base {self.base}; "
                "name at least one end, and every body once"
            )
        unknown = sorted(self.end_offsets.keys() - set(filter(None, self.ends)))
        if unknown:
            raise TrackingError(
                f"offsets of {unknown}, which are no module ends; the ends are "
                f"{list(self.ends)}"
            )

    @classmethod
    def of(cls, modules: int, **offsets) -> "ModuleEnds":
        """Assign the bodies "base", "end-1" to "end-M" to an arm of M modules.

        Args:
            modules: M.
            **offsets: other attributes, such as `base_offset`.

        Raises:
            TrackingError: there is no module.
        """
        return cls(Tracking().end_names(modules), **offsets)

    @classmethod
    def of_arm(cls, arm: ArmSpec, **offsets) -> "ModuleEnds":
        """Assign the bodies that the table `[tracking]` of an arm file names.

        Args:
            arm: without the table, bodies are named as in `of`.
            **offsets: other attributes, such as `base_offset`.

        Raises:
            TrackingError: see `ModuleEnds`.
        """
        tracking = arm.tracking or Tracking()
        names = tracking.end_names(arm.module_count)
        return cls(names, tracking.base or None, **offsets)

    @property
    def bodies(self) -> list[str]:
        """All tracked bodies, the base first."""
        return [name for name in (self.base, *self.ends) if name]

    def find_missing(self, tracker: Tracker) -> str:
        """Describe which bodies the newest frame lacks; empty if it has all."""
        frame = tracker.latest()
        seen = frame.poses if frame is not None else {}
        missing = [name for name in self.bodies if name not in seen]
        if not missing:
            return ""
        cause = tracker.problem or "check its port and the names of its bodies"
        return f"no poses of {', '.join(missing)} arrive: {cause}"

    def states(self, frame: PoseFrame) -> Float[np.ndarray, "modules 6"]:
        """Compute the states of all modules in a frame of a tracker.

        Returns:
            End position [m] and end axis, base frame; a row of NaN for a module whose
            end or base is lost.
        """
        states = np.full((len(self.ends), 6), np.nan)
        arm_from_world = self._arm_from_world(frame)
        if arm_from_world is None:
            return states
        for row, name in zip(states, self.ends, strict=True):
            body = frame.poses.get(name)
            if body is None:
                continue
            offset = self.end_offsets.get(name, Pose.identity())
            end = arm_from_world @ body @ offset
            row[POSITION] = end.position
            row[AXIS] = end.z_axis
        return states

    def _arm_from_world(self, frame: PoseFrame) -> Pose | None:
        """`T_arm_world`; None while the base is lost."""
        base = Pose.identity()
        if self.base is not None:
            if self.base not in frame.poses:
                return None
            base = frame.poses[self.base]
        return (base @ self.base_offset).inverse()


def await_poses(find_problem: Callable[[], str], advice: str) -> None:
    """Wait for the first poses.

    Args:
        find_problem: says what the newest frame lacks; empty if it has all poses.
        advice: what a user should do without them.

    Raises:
        TrackingError: they do not arrive in time.
    """
    end = time.monotonic() + FIRST_POSES
    while problem := find_problem():
        if time.monotonic() > end:
            raise TrackingError(f"{problem} ({FIRST_POSES:g} s); {advice}")
        time.sleep(POLL_PERIOD)
