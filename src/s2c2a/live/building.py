"""The arm's control, made in whatever process it shall run in."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.live.control import ArmControl
from s2c2a.planning import Guard
from s2c2a.robots import Body
from s2c2a.strategies import (
    Strategy,
    load_strategy,
    pcc_strategy,
    recipe_named,
    s2c2a_strategy,
    shipped_networks,
)
from s2c2a.tasks import TASKS, Task, task_named

LATER = ("circle", "follow")  # they solve for what is within reach


def arm_control(
    arm: ArmSpec, files: tuple[str, ...], body: Body, guard: Guard, seed: int, release_after: float
) -> ArmControl:
    """A control that is not started yet; options as of `s2c2a live`.

    Raises:
        S2C2AError: no networks for this arm, or an option that it cannot have.
    """
    robot = body.make(arm, seed=seed)
    return ArmControl(robot, strategies_of(arm, files, guard), Tasks(arm), release_after=release_after)


class Tasks(Mapping[str, Task]):
    """All tasks that an arm can have, by name; two are made when first looked up, since they take a second."""

    def __init__(self, arm: ArmSpec):
        """Make those that are quick, and see which there are."""
        self._made, self._names = cache(partial(task_named, arm=arm)), list(LATER)
        for name in TASKS:
            with suppress(S2C2AError):  # an arm of one module has no middle to hold
                if name not in LATER:
                    self._made(name)
                    self._names.append(name)

    def __getitem__(self, name: str) -> Task:
        """The task of this name."""
        if name not in self._names:
            raise KeyError(name)
        return self._made(name)

    def __iter__(self) -> Iterator[str]:
        """All names, in the usual order."""
        return (name for name in TASKS if name in self._names)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._names)


def strategies_of(arm: ArmSpec, files: tuple[str, ...], guard: Guard) -> dict[str, Callable[[], Strategy]]:
    """What can drive an arm, by name, built when first asked for; files come first, else what comes with the package.

    For an arm of the user's own no networks come with the package, and `pcc` needs none.

    Raises:
        StrategyError: a file cannot be read.
    """
    networks = {f"s2c2a · {Path(file).stem}": load_strategy(file, arm) for file in files}
    with suppress(StrategyError):
        networks = networks or {"s2c2a · best": shipped_networks(arm)}
    built: dict[str, Callable[[], Strategy]] = {
        name: cache(partial(s2c2a_strategy, one, guard)) for name, one in networks.items()
    }
    for recipe in ("best", "paper"):
        options = replace(recipe_named(recipe).planner, guard=guard)
        built[f"pcc · {recipe}"] = cache(partial(pcc_strategy, arm, options))
    return built
