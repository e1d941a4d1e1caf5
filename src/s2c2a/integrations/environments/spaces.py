"""Actions and observations of the environments: their layout, units and frames.

An action is the change of the controllable bends in one control step, as shares of the
arm's `step_limit_deg`: 1 is as fast as the arm may bend. A module has two controllable
bends, in its own frame; a planar module has one, a passive module none.

An observation is one vector of float32; L is the length of the arm:

| part              | length       | unit   | frame  | source                         |
| ----------------- | ------------ | ------ | ------ | ------------------------------ |
| `bends`           | controls     | rad    | module | motor encoders or pressures    |
| `commanded_bends` | controls     | rad    | module | last command that was sent     |
| `last_action`     | controls     | 1      | module | last action                    |
| `tip_position`    | 3            | L      | base   | tracking                       |
| `tip_axis`        | 3            | 1      | base   | tracking                       |
| `goal_offset`     | 3            | L / 10 | base   | goal minus tip                 |
| `goal_change`     | 3            | L / 10 | base   | motion of the goal in one step |
| `obstacle`        | 4            | L      | base   | center minus tip, and radius   |

Only the task `Avoid` has the last part. Values are limited to +-10.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import AXIS, POSITION, Actions

OFFSET_UNIT = 0.1  # arm lengths; so that errors of a centimeter are not small numbers
MAX_VALUE = 10.0  # in the units above, beyond what arms reach; spaces need bounds
VECTORS = ("tip_position", "tip_axis", "goal_offset", "goal_change")

Batch3 = Float[np.ndarray, "batch 3"]


@dataclass(frozen=True)
class Controls:
    """The controllable bends of an arm, and commands from them.

    Attributes:
        arm: the arm.
        geometry: its arrays.
    """

    arm: ArmSpec
    geometry: ArmGeometry

    @classmethod
    def of(cls, arm: ArmSpec) -> "Controls":
        """Controls of an arm."""
        return cls(arm, ArmGeometry.of(arm))

    @cached_property
    def basis(self) -> Float[np.ndarray, "controls modules 2"]:
        """Orthonormal directions of the bends that cables command."""
        geometry = self.geometry
        rows = []
        for module, inverse in enumerate(geometry.bend_matrices):
            if geometry.steerable is None:
                directions = np.eye(2)
            else:
                left, sizes, _ = np.linalg.svd(inverse)
                directions = left[:, sizes > 1e-9 * max(sizes.max(), 1.0)].T
            for direction in directions:
                row = np.zeros((self.arm.module_count, 2))
                row[module] = direction
                rows.append(row)
        return np.array(rows)

    @property
    def count(self) -> int:
        """Number of controllable bends."""
        return len(self.basis)

    def bends(self, cables: Actions) -> Float[np.ndarray, "*batch controls"]:
        """Controllable bends [rad] of cables or commands [m, N or Pa]."""
        bends = self.geometry.commanded_bends(cables)
        return np.einsum("kmi,...mi->...k", self.basis, bends)

    def commands(self, bends: Float[np.ndarray, "*batch controls"]) -> Actions:
        """Commands [m, N or Pa] for controllable bends [rad]; not limited."""
        shares = np.einsum("kmi,...k->...mi", self.basis, bends)
        return self.geometry.actions_at(shares / self.geometry.action_bends[:, None])


def observation_parts(controls: Controls, obstacle: bool = False) -> dict[str, slice]:
    """Where the parts of an observation are, by name."""
    lengths = dict.fromkeys(("bends", "commanded_bends", "last_action"), controls.count)
    lengths |= dict.fromkeys(VECTORS, 3)
    if obstacle:
        lengths["obstacle"] = 4
    ends = np.cumsum([0, *lengths.values()]).tolist()
    return {
        name: slice(start, end)
        for name, (start, end) in zip(lengths, pairwise(ends), strict=True)
    }


def observe(
    controls: Controls,
    cables: Actions,
    command: Actions,
    action: Float[np.ndarray, "batch controls"],
    tip: Float[np.ndarray, "batch 6"],
    goal: Batch3,
    goal_change: Batch3,
    obstacle: Float[np.ndarray, "batch 4"] | None = None,
) -> Float[np.ndarray, "batch values"]:
    """Observations of a batch; see the table of this module.

    Args:
        controls: of the arm.
        cables: measured, shape (batch, modules, cables).
        command: last command sent, likewise.
        action: last action.
        tip: position [m] and axis, base frame.
        goal: position for the end of the next step [m], base frame.
        goal_change: motion of the goal in that step [m], base frame.
        obstacle: center and radius [m], base frame.
    """
    length = controls.arm.length
    position = tip[:, POSITION]
    parts = [
        *controls.bends(np.stack([cables, command])),
        action,
        position / length,
        tip[:, AXIS],
        (goal - position) / (OFFSET_UNIT * length),
        goal_change / (OFFSET_UNIT * length),
    ]
    if obstacle is not None:
        parts += [(obstacle[:, :3] - position) / length, obstacle[:, 3:] / length]
    values = np.concatenate(parts, axis=-1)
    return np.clip(values, -MAX_VALUE, MAX_VALUE).astype(np.float32)
