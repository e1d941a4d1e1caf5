"""What may change a goal before the terms see it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp

from s2c2a.arm import ArmSpec
from s2c2a.kinematics import ForwardModel
from s2c2a.parts import Part
from s2c2a.planning.situation import Guard, Situation, norm
from s2c2a.spaces import POSITION


@dataclass(frozen=True)
class Guide(Part, ABC):
    """Changes what is asked in a control step, such as a target that cannot be gone to straight."""

    @abstractmethod
    def prepared(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> Any:
        """What it has to know of an arm, worked out once: a pytree, None if nothing."""

    @abstractmethod
    def lead(self, situation: Situation, prepared: Any) -> Situation:
        """The situation with another goal, or another shape to lead to."""


@dataclass(frozen=True)
class Pull(Guide):
    """Draws targets nearer that are far away: from there they pull no less, and steps stay those that the data hold.

    Attributes:
        longest: way to a target, in parts of the arm's length.
    """

    longest: float = 0.035

    def prepared(self, arm: ArmSpec, model: ForwardModel, guard: Guard) -> None:
        """Nothing."""

    def lead(self, situation: Situation, prepared: None) -> Situation:
        """All targets at most so far from where the module ends are."""
        goal, now = situation.goal, situation.last.states[:, POSITION]
        way = goal.positions - now
        shares = jnp.minimum(1.0, self.longest * situation.length / jnp.maximum(norm(way), 1e-6))
        goal = goal._replace(positions=now + way * shares[:, None])  # type: ignore[arg-type]
        return situation._replace(goal=goal)
