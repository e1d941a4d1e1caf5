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

Only the task `Avoid` has the last part, and own tasks (`tasks.Family.observe`) may have
others. Values are limited to +-10.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import AXIS, POSITION, Actions, States

OFFSET_UNIT = 0.1  # arm lengths; so that errors of a centimeter are not small numbers
MAX_VALUE = 10.0  # in the units above, beyond what arms reach; spaces need bounds
VECTORS = ("tip_position", "tip_axis", "goal_offset", "goal_change")

Batch3 = Float[np.ndarray, "batch 3"]
BatchValues = Float[np.ndarray, "batch values"]


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


@dataclass(frozen=True)
class BatchMoment:
    """A batch of arms after a control step; everything is in the base frame.

    Attributes:
        cables: measured [m, N or Pa], shape (batch, modules, cables).
        commands: last ones sent, likewise.
        actions: last ones, within [-1, 1].
        states: true ones [m, 1], shape (batch, modules, 6).
        goals: for this moment [m].
        next_goals: for the end of the next step [m].
        obstacles: centers and radii [m]; radius 0 for none.
        steps: control steps since the episodes began.
    """

    cables: Actions
    commands: Actions
    actions: Float[np.ndarray, "batch controls"]
    states: States
    goals: Batch3
    next_goals: Batch3
    obstacles: Float[np.ndarray, "batch 4"]
    steps: Int[np.ndarray, " batch"]

    @property
    def tips(self) -> Batch3:
        """Positions of the tips [m]."""
        return self.states[:, -1, POSITION]


def observation_parts(controls: Controls) -> dict[str, slice]:
    """Where the parts of every observation are, by name; those of a task follow."""
    lengths = dict.fromkeys(("bends", "commanded_bends", "last_action"), controls.count)
    lengths |= dict.fromkeys(VECTORS, 3)
    ends = np.cumsum([0, *lengths.values()]).tolist()
    return {
        name: slice(start, end)
        for name, (start, end) in zip(lengths, pairwise(ends), strict=True)
    }


def observe(controls: Controls, moment: BatchMoment) -> dict[str, BatchValues]:
    """Parts of the observations of a batch; see the table of this module."""
    length = controls.arm.length
    tips = moment.tips
    bends, commanded_bends = controls.bends(np.stack([moment.cables, moment.commands]))
    return {
        "bends": bends,
        "commanded_bends": commanded_bends,
        "last_action": moment.actions,
        "tip_position": tips / length,
        "tip_axis": moment.states[:, -1, AXIS],
        "goal_offset": (moment.next_goals - tips) / (OFFSET_UNIT * length),
        "goal_change": (moment.next_goals - moment.goals) / (OFFSET_UNIT * length),
    }


def joined(parts: Mapping[str, BatchValues]) -> BatchValues:
    """One vector for each arm, of float32 and limited, from the parts of observations."""
    values = np.concatenate(list(parts.values()), axis=-1)
    return np.clip(values, -MAX_VALUE, MAX_VALUE).astype(np.float32)
