"""The parts of the benchmark: each a module of this room with a `measure`, run in a process of its own."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class Part:
    """One part.

    Attributes:
        name: what a user types, and the module in this room.
        cores: that it is kept to.
        about: what it measures.
    """

    name: str
    cores: int
    about: str

    @property
    def measure(self) -> Callable[..., Iterator[Any]]:
        """(options, progress) -> lines, one by one as they are measured; imports what is heavy."""
        return import_module(f"s2c2a.bench.{self.name}").measure


PARTS = {
    part.name: part
    for part in (
        Part("startup", 1, "from the start of a process to its end, and its memory"),
        Part("plan", 1, "one plan, against eager PyTorch, and the room for obstacles"),
        Part("batch", 2, "many plans in one call"),
        Part("step", 1, "what happens in every control step"),
        Part("profile", 1, "pieces of a plan, its operations counted, and how near it is to its floor"),
        Part("jitter", 1, "ticks at 100 Hz with a real clock, and memory over many ticks"),
        Part("collect", 2, "a recording of 9000 samples"),
        Part("training", 2, "both networks, against PyTorch"),
        Part("simulation", 2, "arm seconds simulated in a second, and the error at rest"),
        Part("rods", 1, "the rod cases, against PyElastica"),
        Part("growth", 1, "how times grow with modules, cables, obstacles, waypoints"),
    )
}
"""All parts, in the order in which they run."""
