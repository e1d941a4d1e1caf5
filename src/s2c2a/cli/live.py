"""`s2c2a live`: the arm in the browser."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from s2c2a.cli.console import Arm, FidelityName, GuardName, ModelName
from s2c2a.cli.execution import RobotName, RobotOptions, body_for, require
from s2c2a.spaces import Stage

if TYPE_CHECKING:
    from s2c2a.live.page import LivePage
    from s2c2a.live.process import ControlProcess
    from s2c2a.robots import Body

Port = Annotated[
    int, tyro.conf.arg(help="where the page shall be; the next free one if it is taken")
]


def live(
    arm: Arm = "twin_arm",
    weights: tuple[str, ...] = (),
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    fidelity: FidelityName = "fast",
    guard: GuardName = "tip",
    seed: int = 0,
    port: Port = 8080,
    out: Path = Path("runs"),
    release_after: float = 10.0,
    model: ModelName = None,
) -> None:
    """Open a page in the browser on which the arm is alive: drag the target, push the obstacle.

    The page is on 127.0.0.1 alone; from another machine, go through `ssh -L`.

    Args:
        arm: a preset or an arm file.
        weights: files made by `s2c2a train`, the first one drives; without any, the
            networks that come with the package for the presets, and `pcc` for an arm of
            your own.
        robot: what is driven: the simulated arm, or a class of your own.
        robot_option: what that class takes.
        fidelity: of the simulation.
        guard: what keeps out of obstacles: the tip, or the whole arm.
        seed: of the simulation's noise.
        port: where the page shall be; the next free one if it is taken.
        out: the folder in which recordings get folders of their own.
        release_after: seconds without a driver until the arm is led back to rest; until
            then it holds.
        model: the class of a forward model of your own that a strategy file names.
    """
    require("live", "viser", "websockets", "msgspec")
    body = body_for(robot, robot_option, fidelity)
    said = partial(print, flush=True)
    options = {
        "weights": weights,
        "guard": guard,
        "seed": seed,
        "release_after": release_after,
        "model": model,
    }
    with running_page(arm, body, port, out, said, **options) as (control, _):
        wait_for_interrupt()
    latest = control.latest
    print(
        f"{arm} has ended{', at rest' if latest and latest.stage is Stage.IDLE else '; look whether it is at rest'}."
    )


def wait_for_interrupt() -> None:
    """Return at Control-C."""
    with suppress(KeyboardInterrupt):
        threading.Event().wait()


@contextmanager
def running_page(
    arm: str,
    body: "Body | None" = None,
    port: int = 8080,
    out: Path = Path("runs"),
    said: "Callable[[str], None]" = lambda _: None,
    **options: Any,
) -> "Iterator[tuple[ControlProcess, LivePage]]":
    """The control process and its page, closed in the end; options of `arm_control`. `said` is told how far it is.

    Raises:
        S2C2AError: no networks for this arm, no free port, or the arm did not open.
    """
    from s2c2a.arm import load_arm
    from s2c2a.live.process import ControlProcess

    spec = load_arm(arm)
    with ExitStack() as ends:
        build = partial(
            _called,
            "s2c2a.live.control:arm_control",
            spec,
            body or body_for("sim", ()),
            **options,
        )
        control = ControlProcess(spec, build)
        ends.callback(control.stop)
        # imported while the other process imports its part
        from s2c2a.live.page import LivePage

        page = LivePage(
            control, port, out, partial(_called, "s2c2a.live.workspace:survey", spec)
        )
        ends.callback(page.close)
        said(f"open {page.gate.address}")
        control.wait_until_ready()
        said(f"{arm} is alive; Control-C ends it.")
        yield control, page


def _called(place: str, *arguments: Any, **options: Any) -> Any:
    """What a function makes whose module is imported only where and when it is called."""
    return resolve_name(place)(*arguments, **options)
