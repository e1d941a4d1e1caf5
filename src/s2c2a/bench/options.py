"""What to measure with, and how often."""

from dataclasses import dataclass, replace
from typing import Literal

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError

COUNTS = ("repeats", "long_repeats", "ticks", "memory_ticks")
QUICKER = 20  # times


@dataclass(frozen=True)
class BenchOptions:
    """Options of all parts.

    Attributes:
        arm: the arm.
        seed: of data, networks and everything else random.
        repeats: of what takes milliseconds.
        long_repeats: of what takes seconds.
        ticks: at 100 Hz with a real clock.
        memory_ticks: one after the other, while the memory is watched.
        device: that JAX computes on.
        quick: whether growth is followed over a few small sizes alone, and training is cut short.
        whole: whether PyTorch trains as many epochs as we do, or one for every call of ours.
    """

    arm: ArmSpec
    seed: int = 0
    repeats: int = 1000
    long_repeats: int = 5
    ticks: int = 10_000
    memory_ticks: int = 100_000
    device: Literal["cpu", "gpu"] = "cpu"
    quick: bool = False
    whole: bool = False

    def __post_init__(self):
        """Refuse what measures nothing."""
        for name in COUNTS:
            if getattr(self, name) < 1:
                raise S2C2AError(f"{name} {getattr(self, name)} asked for; take at least one")
        if self.seed < 0:
            raise S2C2AError(f"seed {self.seed} asked for; it must not be negative")

    def quicker(self) -> "BenchOptions":
        """A twentieth of all counts, few sizes, few epochs: a look, not a result."""
        fewer = {name: max(1, getattr(self, name) // QUICKER) for name in COUNTS}
        return replace(self, **fewer, quick=True)
