"""Command `s2c2a teleoperate`: drive an arm by keyboard or gamepad in the terminal."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.cli.execution import require
from s2c2a.live.cli.driven_arm import SIMULATED, DrivenRobot, seed_where_used

if TYPE_CHECKING:
    from s2c2a.arm import ArmSpec
    from s2c2a.live.control import ArmControl, Strategies
    from s2c2a.robots.factory import RobotFactory

ArmFile = tyro.conf.Positional[Annotated[str, tyro.conf.arg(metavar="PRESET|FILE")]]
DeviceName = Annotated[str, tyro.conf.arg(metavar="keyboard|gamepad|FILE.py:Class")]
StrategyOrNone = Annotated[str, tyro.conf.arg(metavar="s2c2a|pcc|FILE.py:Class")]
REST_AFTER = 0.1  # s without a driver; the button for rest acts at once


@seed_where_used
def teleoperate(
    arm: ArmFile = "twin_arm",
    device: DeviceName = "keyboard",
    out: Path | None = None,
    strategy: StrategyOrNone = "",
    weights: tuple[str, ...] = (),
    driven: DrivenRobot = SIMULATED,
) -> None:
    """Drive an arm in the terminal, and record demonstrations.

    The device moves the target, by at most a quarter of the arm's length a second. The
    arm follows it, and stays where it is while no key is held. Ctrl-C ends the command,
    and the arm returns to rest.

    Args:
        arm: a preset or an arm file.
        device: keyboard of this terminal, gamepad, or your own class.
        out: file of the demonstrations, such as demos.episodes; further ones are
            appended. Without it nothing is recorded.
        strategy: that follows the target; by default that of the first weights or of
            the package's networks for the arm, else pcc.
        weights: files from `s2c2a train`.
        driven: robot and random seed.
    """
    from s2c2a.arm import load_arm
    from s2c2a.integrations.teleoperation.demonstrations import Demonstrations
    from s2c2a.integrations.teleoperation.devices import device_named
    from s2c2a.integrations.teleoperation.teleoperation import Teleoperation
    from s2c2a.live.steering import largest_speed

    if device == "gamepad":
        require("gamepad", "pygame")
    spec = load_arm(arm)
    factory = driven.factory()
    source = device_named(device, largest_speed(spec))
    options = {"robot": str(factory), "device": device, "seed": driven.seed}
    with ExitStack() as stack:
        print(f"preparing {spec.name}; the first start compiles for one or two minutes")
        control = _control(spec, factory, strategy, weights, driven.seed)
        demonstrations = None
        if out is not None:
            demonstrations = Demonstrations(out, control, options)
            stack.callback(demonstrations.close)
        stack.enter_context(source)
        print(f"{device}: {source.help}")
        stack.enter_context(_running(control))
        with suppress(KeyboardInterrupt):
            Teleoperation(control, source, demonstrations).run(_show)
        print(f"\n{spec.name} returns to rest.")
    if out is not None and out.exists():
        print(f"demonstrations: {out}")


def _control(
    spec: "ArmSpec",
    factory: "RobotFactory",
    strategy: str,
    weights: tuple[str, ...],
    seed: int,
) -> "ArmControl":
    """Control of the arm that is not started, by one strategy."""
    from s2c2a.live.control import ArmControl

    strategies = strategies_named(spec, strategy, weights)
    return ArmControl(factory.make(spec, seed=seed), strategies, {}, REST_AFTER)


def strategies_named(
    spec: "ArmSpec", strategy: str, weights: tuple[str, ...]
) -> "Strategies":
    """Strategies that can drive an arm; the first is the one that was named.

    Raises:
        S2C2AError: there is no such strategy, or it needs training.
    """
    from s2c2a.live.control import strategies_of
    from s2c2a.strategies import strategy_named

    known = strategies_of(spec, weights, "tip")
    if not strategy:
        return known
    label = strategy_named(strategy).name
    if not any(_is_of(name, label) for name in known):
        known = strategies_of(spec, weights, "tip", (strategy,))
    return {name: known[name] for name in known if _is_of(name, label)}


def _is_of(name: str, label: str) -> bool:
    """Whether a strategy's name is a label, or begins with it, such as "pcc · best"."""
    return name.split(" · ")[0] == label


@contextmanager
def _running(control: "ArmControl") -> Iterator[None]:
    """Run the control; at the end the arm returns to rest, whatever is pressed."""
    from s2c2a.emergency import EMERGENCY_STOP
    from s2c2a.runtime.emergency import stop_on_signal
    from s2c2a.runtime.interrupts import ignored_interrupts

    EMERGENCY_STOP.reset()
    with stop_on_signal():
        try:
            control.start()
            yield
        finally:
            with ignored_interrupts():
                control.stop()


def _show(line: str) -> None:
    """Replace the status line of a terminal."""
    if sys.stdout.isatty():
        sys.stdout.write(f"\r\x1b[K{line}")
        sys.stdout.flush()
