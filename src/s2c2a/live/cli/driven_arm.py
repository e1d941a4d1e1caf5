"""Options of the commands that drive an arm until they are ended."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from s2c2a.cli.console import FidelityName, GuardName
from s2c2a.cli.dependent_options import effective
from s2c2a.cli.execution import (
    RobotName,
    RobotOptions,
    TrackingSource,
    robot_factory_for,
)
from s2c2a.robots.factory import RobotFactory
from s2c2a.spaces import Stage

if TYPE_CHECKING:
    from s2c2a.live.process import ControlProcess


@dataclass(frozen=True)
class _DrivenArm:
    """The robot that is driven, and its control.

    Attributes:
        seed: random seed of the simulated noise.
        weights: files from `s2c2a train`, or "shipped" for the networks of the package;
            the first one drives. By default shipped networks for an arm that has
            them, and `pcc` for others.
        guard: what avoids obstacles: the tip, or the whole arm.
        release_after: time without a driver until the arm returns to rest [s]; until
            then it holds its position.
    """

    robot: RobotName = "sim"
    robot_option: RobotOptions = ()
    tracking: TrackingSource = ""
    fidelity: FidelityName = "fast"
    seed: int = 0
    weights: tuple[str, ...] = ()
    guard: GuardName = "tip"
    release_after: float = 10.0

    def factory(self) -> RobotFactory:
        """The robot, which is not opened."""
        return robot_factory_for(
            self.robot, self.robot_option, self.fidelity, tracking=self.tracking
        )

    def control_options(self, strategies: tuple[str, ...]) -> dict[str, Any]:
        """Options of `arm_control`."""
        return {
            "weights": self.weights,
            "strategies": strategies,
            "guard": self.guard,
            "seed": self.seed,
            "release_after": self.release_after,
        }


SIMULATED_ARM = _DrivenArm()
DrivenArm = Annotated[_DrivenArm, tyro.conf.arg(name="")]

seed_where_used = effective(
    "seed",
    where="with the simulated arm, or a robot class that has a seed",
    holds=lambda given: RobotFactory(given["robot"]).accepts("seed"),
)


def print_remarks(weights: Iterable[str]) -> None:
    """Say which sessions correct the weights, and warn of controllers that err much."""
    from s2c2a.evaluation import describe_controller
    from s2c2a.strategies import describe_use, session_of
    from s2c2a.strategies.checkpoint import SHIPPED
    from s2c2a.strategies.files import stated_errors

    for file in weights:
        if file == SHIPPED:
            continue
        session = session_of(file)
        if session is not None:
            print(describe_use(session))
        if text := describe_controller(*stated_errors(file)):
            print(f"{file}: {text}")


def print_end(arm: str, control: "ControlProcess") -> None:
    """Say whether the arm is at rest."""
    latest = control.latest
    at_rest = latest and latest.stage is Stage.IDLE
    state = "at rest" if at_rest else "check whether it is at rest"
    print(f"{arm} has stopped; {state}.")
