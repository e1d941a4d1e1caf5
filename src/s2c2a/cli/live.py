"""`s2c2a live`: the arm in the browser."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from s2c2a.cli.console import Arm, FidelityName, GuardName
from s2c2a.cli.crews import require

if TYPE_CHECKING:
    from collections.abc import Callable

    from s2c2a.arm import ArmSpec
    from s2c2a.live.loop import ControlLoop
    from s2c2a.live.page import LivePage, Survey
    from s2c2a.live.process import ControlProcess
    from s2c2a.planning.options import Guard

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
    require("live", "viser", "websockets", "msgspec")
    with running_page(arm, strategy, fidelity, guard, seed, port, out, release_after, said=partial(print, flush=True)):
        wait_for_interrupt()
    print(f"{arm} has ended, at rest.")


def wait_for_interrupt() -> None:
    """Return at Control-C."""
    with suppress(KeyboardInterrupt):
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
    said: "Callable[[str], None]" = lambda _: None,
) -> "Iterator[tuple[ControlProcess, LivePage]]":
    """The control process and its page, closed in the end; options as in `live`. `said` is told how far it is.

    Raises:
        S2C2AError: no networks for this arm, no free port, or the arm did not open.
    """
    from s2c2a.arm import load_arm
    from s2c2a.live.child import Child
    from s2c2a.live.process import ControlProcess

    spec = load_arm(arm)
    control = ControlProcess(spec, Child(partial(_control_loop, spec, strategy, fidelity, guard, seed, release_after)))
    try:
        from s2c2a.live.page import LivePage  # imported while the other process imports its part

        page = LivePage(control, port, out, partial(_survey, spec))
        try:
            said(f"open {page.gate.address}")
            control.wait_until_ready()
            said(f"{arm} is alive; Control-C ends it.")
            yield control, page
        finally:
            page.close()
    finally:
        control.stop()


def _control_loop(*options: Any) -> "ControlLoop":
    """What the other process makes."""
    from s2c2a.live.simulated import simulated_loop

    return simulated_loop(*options)


def _survey(arm: "ArmSpec") -> "Survey":
    """What the page knows of the arm's reach, a little after the arm has moved first."""
    from s2c2a.live.workspace import survey

    return survey(arm)
