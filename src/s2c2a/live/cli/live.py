"""Command `s2c2a live`: interactive control of an arm in the browser."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import tyro

from s2c2a.cli.console import Arm, SceneFile, StrategyNames
from s2c2a.cli.execution import require, robot_factory_for
from s2c2a.errors import S2C2AError
from s2c2a.live.cli.driven_arm import (
    SIMULATED_ARM,
    DrivenArm,
    print_end,
    print_remarks,
    seed_where_used,
)
from s2c2a.robots.factory import RobotFactory

if TYPE_CHECKING:
    from s2c2a.live.page import LivePage
    from s2c2a.live.process import ControlProcess
    from s2c2a.live.request import Obstacle

PREPARING = "{} is being prepared; its first start compiles for a minute or more"
Port = Annotated[
    int, tyro.conf.arg(help="port of the page; the next free one if it is taken")
]
THIS_MACHINE: Final = "127.0.0.1"
Host = Literal["127.0.0.1", "0.0.0.0"]


@seed_where_used
def live(
    arm: Arm = "twin_arm",
    strategy: StrategyNames = (),
    driven: DrivenArm = SIMULATED_ARM,
    scene: SceneFile = None,
    port: Port = 8080,
    host: Host = THIS_MACHINE,
    out: Path = Path("runs"),
) -> None:
    """Control an arm in the browser: drag its target, move an obstacle.

    The page is reachable from this machine only (127.0.0.1); from another machine, use
    `ssh -L`.

    Args:
        strategy: more strategies without training, by name or your own file.py:Class.
        driven: robot, weights and control.
        scene: a file of obstacles that stand there from the start, and can be dragged
            (docs/guides/obstacles.md).
        port: port of the page; the next free one if it is taken.
        host: address to listen on. 0.0.0.0 is for a container whose port is published
            on 127.0.0.1 of its host, and for the simulated arm only.
        out: folder of the run directories of recordings.
    """
    require("live", "viser", "websockets", "msgspec")
    factory = driven.factory()
    # raise S2C2AError if other machines could move a real arm
    if host != THIS_MACHINE and not factory.simulated:
        raise S2C2AError(
            f"--host {host} lets other machines connect, and {factory.name} may be a "
            "real arm; leave out --host, and use `ssh -L` from another machine"
        )
    on_message = partial(print, flush=True)
    options = driven.control_options(strategy) | {"host": host}
    print_remarks(driven.weights)
    obstacles = _obstacles_of(scene) if scene else ()
    with running_page(arm, factory, port, out, on_message, **options) as (control, _):
        if obstacles:
            control.ask(obstacles=obstacles)
        wait_for_interrupt()
    print_end(arm, control)


def _obstacles_of(scene: Path) -> "tuple[Obstacle, ...]":
    """Obstacles of a scene file, where they first stand; the page has no time of its own.

    Raises:
        S2C2AError: the file is not valid, or holds more than the page shows.
    """
    from s2c2a.live.request import MAX_OBSTACLES, Obstacle
    from s2c2a.tasks import load_scene

    rows = [row for solid in load_scene(scene).obstacles for row in solid.rows()]
    if len(rows) > MAX_OBSTACLES:
        raise S2C2AError(
            f"{scene} holds {len(rows)} obstacles, and the live page shows at most "
            f"{MAX_OBSTACLES}; leave some out"
        )
    return tuple(map(Obstacle.of, rows))


def wait_for_interrupt() -> None:
    """Return at Ctrl-C."""
    with suppress(KeyboardInterrupt):
        while True:  # Ctrl-C ends no wait for an event on Windows
            time.sleep(1.0)


@contextmanager
def running_page(
    arm: str,
    factory: RobotFactory | None = None,
    port: int = 8080,
    out: Path = Path("runs"),
    on_message: "Callable[[str], None]" = lambda _: None,
    host: str = THIS_MACHINE,
    **options: Any,
) -> "Iterator[tuple[ControlProcess, LivePage]]":
    """Run the control process and its page; close both at the end.

    Args:
        arm: a preset or an arm file.
        factory: the robot; the simulated arm if None.
        port: port of the page.
        out: folder of recordings.
        on_message: called with messages for the user.
        host: address to listen on.
        options: of `arm_control`.

    Raises:
        S2C2AError: no networks for this arm, no free port, or the arm did not open.
    """
    from s2c2a.arm import load_arm
    from s2c2a.live.process import ControlProcess

    on_message(PREPARING.format(arm))
    spec = load_arm(arm)
    robot = factory or robot_factory_for("sim", ())
    with ExitStack() as stack:
        build = partial(
            import_and_call, "s2c2a.live.control:arm_control", spec, robot, **options
        )
        control = ControlProcess(spec, build)
        # before the arm opens, and until it is at rest again
        stack.enter_context(signal_stops(control))
        stack.callback(control.stop)
        # this import runs while the control process does its own
        from s2c2a.live.page import LivePage

        survey = partial(import_and_call, "s2c2a.live.workspace:survey", spec)
        page = LivePage(control, port, out, survey, host)
        stack.callback(page.close)
        on_message(f"open {page.gate.address}")
        control.wait_until_ready()
        on_message(f"{arm} is running; Ctrl-C stops it.")
        yield control, page


@contextmanager
def signal_stops(control: "ControlProcess") -> "Iterator[None]":
    """Let SIGUSR1 to this process stop the arm at once."""
    # not on Windows; only the main thread receives signals
    is_main = threading.current_thread() is threading.main_thread()
    if not (hasattr(signal, "SIGUSR1") and is_main):
        yield
        return
    before = signal.signal(signal.SIGUSR1, lambda *_: control.stop_at_once())
    try:
        yield
    finally:
        signal.signal(signal.SIGUSR1, before)


def import_and_call(name: str, *arguments: Any, **options: Any) -> Any:
    """Import a function when it is called, in the process that calls it."""
    return resolve_name(name)(*arguments, **options)
