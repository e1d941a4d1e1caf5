"""`s2c2a live`: the arm in the browser."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from s2c2a.cli.console import Arm, FidelityName, GuardName
from s2c2a.cli.crews import require

if TYPE_CHECKING:
    from collections.abc import Callable

    from s2c2a.arm import ArmSpec
    from s2c2a.live.loop import ControlLoop
    from s2c2a.live.page import LivePage
    from s2c2a.planning.options import Guard
    from s2c2a.strategies import Strategy

Port = Annotated[int, tyro.conf.arg(help="where the page shall be; the next free one if it is taken")]

TURN = 0.0005  # s after which Python lets another thread go on: the control thread gets its turn soon


def live(
    arm: Arm = "twin_arm",
    strategy: tuple[str, ...] = (),
    robot: Literal["sim"] = "sim",
    fidelity: FidelityName = "fast",
    guard: GuardName = "tip",
    seed: int = 0,
    port: Port = 8080,
    out: Path = Path("runs"),
    release_after: float = 10.0,
) -> None:
    """Open a page in the browser on which the arm is alive: drag the target, push the obstacle.

    The page is on 127.0.0.1 alone; from another machine, go through `ssh -L`.

    Args:
        arm: a preset or an arm file.
        strategy: files made by `s2c2a train`, the first one drives; without any, the networks that come with the
            package for the presets.
        robot: what is driven: the simulated arm.
        fidelity: of the simulation.
        guard: what keeps out of obstacles: the tip, or the whole arm.
        seed: of the simulation's noise.
        port: where the page shall be; the next free one if it is taken.
        out: the folder in which recordings get folders of their own.
        release_after: seconds without a driver until the arm is led back to rest; until then it holds.
    """
    require("live", "viser", "websockets", "msgspec")
    with running_page(arm, strategy, fidelity, guard, seed, port, out, release_after) as (_, page):
        print(f"{arm} is alive: {page.gate.address}\nControl-C ends it.", flush=True)
        threading.Event().wait()


@contextmanager
def running_page(
    arm: str,
    strategy: tuple[str, ...] = (),
    fidelity: str = "fast",
    guard: "Guard" = "tip",
    seed: int = 0,
    port: int = 8080,
    out: Path = Path("runs"),
    release_after: float = 10.0,
) -> "Iterator[tuple[ControlLoop, LivePage]]":
    """A loop that runs and its page, closed in the end; options as in `live`.

    Raises:
        S2C2AError: no networks for this arm, no free port, or the arm did not open.
    """
    from s2c2a.arm import load_arm
    from s2c2a.live.loop import ControlLoop
    from s2c2a.live.page import LivePage
    from s2c2a.live.workspace import workspace
    from s2c2a.robots.simulation import SimulatedRobot
    from s2c2a.tasks import TASKS, task_named

    sys.setswitchinterval(TURN)
    spec = load_arm(arm)
    strategies = strategies_of(spec, strategy, guard)
    name, build = next(iter(strategies.items()))
    body = SimulatedRobot(spec, fidelity, seed)
    tasks = {task: task_named(task, spec) for task in TASKS}
    loop = ControlLoop(body, build(), tasks, body, release_after=release_after, name=name)
    loop.start()
    try:
        page = LivePage(loop, strategies, port, out, lambda: workspace(spec))
        try:
            yield loop, page
        finally:
            page.close()
    finally:
        loop.stop()


def strategies_of(arm: "ArmSpec", files: tuple[str, ...], guard: "Guard") -> "dict[str, Callable[[], Strategy]]":
    """What can drive an arm, by name, built when first asked for."""
    from dataclasses import replace
    from functools import cache, partial

    from s2c2a.strategies import load_strategy, pcc_strategy, recipe_named, s2c2a_strategy, shipped_networks

    saved = {f"s2c2a · {Path(file).stem}": load_strategy(file, arm) for file in files}
    networks = saved or {"s2c2a · best": shipped_networks(arm)}
    built: dict[str, Callable[[], Strategy]] = {
        name: cache(partial(s2c2a_strategy, one, guard)) for name, one in networks.items()
    }
    for recipe in ("best", "paper"):
        options = replace(recipe_named(recipe).planner, guard=guard)
        built[f"pcc · {recipe}"] = cache(partial(pcc_strategy, arm, options))
    return built
