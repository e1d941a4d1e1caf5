"""`s2c2a live`: the arm in the browser."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from s2c2a.cli.console import Arm, FidelityName, GuardName

if TYPE_CHECKING:
    from collections.abc import Callable

    from s2c2a.arm import ArmSpec
    from s2c2a.planning.options import Guard
    from s2c2a.strategies import Strategy

Port = Annotated[int, tyro.conf.arg(help="where the page shall be; the next free one if it is taken")]


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
    need_extra("live", "viser", "websockets", "msgspec")
    from s2c2a.arm import load_arm

    spec = load_arm(arm)
    serve(spec, strategies_of(spec, strategy, guard), fidelity, seed, port, out, release_after)


def serve(
    arm: "ArmSpec",
    strategies: "dict[str, Callable[[], Strategy]]",
    fidelity: str,
    seed: int,
    port: int,
    out: Path,
    release_after: float,
) -> None:
    """Drive and show until interrupted."""
    import sys
    import threading

    from s2c2a.live.loop import ControlLoop
    from s2c2a.live.page import LivePage
    from s2c2a.live.workspace import workspace
    from s2c2a.robots.simulation import SimulatedRobot
    from s2c2a.tasks import TASKS, task_named

    sys.setswitchinterval(0.0005)  # the control thread gets its turn soon, whatever the page computes
    body = SimulatedRobot(arm, fidelity, seed)
    name, build = next(iter(strategies.items()))
    tasks = {task: task_named(task, arm) for task in TASKS}
    loop = ControlLoop(body, build(), tasks, body, release_after=release_after, name=name)
    loop.start()
    try:
        page = LivePage(loop, strategies, port, out, lambda: workspace(arm))
        try:
            print(f"{arm.name} is alive: {page.gate.address}\nControl-C ends it.", flush=True)
            threading.Event().wait()
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


def need_extra(extra: str, *modules: str) -> None:
    """Say what to install where something is missing.

    Raises:
        S2C2AError: a module of the extra is not there.
    """
    from importlib.util import find_spec

    from s2c2a.errors import S2C2AError

    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise S2C2AError(f'{", ".join(missing)} is missing; install it with pip install "s2c2a[{extra}]"')
