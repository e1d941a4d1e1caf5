"""What runs are made under: which body is driven, and what is guarded."""

from dataclasses import dataclass

from s2c2a.planning import Guard
from s2c2a.robots import Body


@dataclass(frozen=True)
class Conditions:
    """What runs are made under.

    Attributes:
        body: what is driven.
        guard: what keeps out of obstacles.
    """

    body: Body = Body()  # noqa: RUF009 (it is frozen)
    guard: Guard = "tip"

    @property
    def fidelity(self) -> str:
        """Of the simulation, for rows; the body's name where there is none."""
        return str(dict(self.body.options).get("fidelity", self.body.name))


SIMULATED_FAST = Conditions()
