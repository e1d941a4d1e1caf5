"""Configurations of the robot `s2c2a` and of the teleoperator `s2c2a_expert`."""

from dataclasses import dataclass, field

from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


@RobotConfig.register_subclass("s2c2a")
@dataclass(kw_only=True)
class S2C2ARobotConfig(RobotConfig):
    """An arm of S2C2A.

    Attributes:
        arm: a preset or an arm file.
        robot: "sim", "dynamixel", "feetech", or a class of yours (my_arm.py:MyArm).
        robot_option: arguments of that class, such as port=/dev/ttyUSB0.
        tracking: source of the poses of a real arm's module ends.
        sensors: names of the sensors in observations; by default those that every
            reading has.
        action_space: "cables" (displacements [m] or tensions [N]) or "tip" (target of
            the tip [m], base frame, which a strategy follows).
        weights: of that strategy: a file of `s2c2a train`, or "shipped"; PCC without.
    """

    arm: str = "twin_arm"
    robot: str = "sim"
    robot_option: list[str] = field(default_factory=list)
    tracking: str = ""
    sensors: list[str] = field(default_factory=list)
    action_space: str = "cables"
    weights: str = ""


@TeleoperatorConfig.register_subclass("s2c2a_expert")
@dataclass(kw_only=True)
class S2C2AExpertConfig(TeleoperatorConfig):
    """A strategy that shows a task on the connected robot of the same id.

    Attributes:
        task: a name, a file of waypoints (.csv), or file.py:function; it repeats.
        weights: of the strategy: a file of `s2c2a train`, or "shipped"; PCC without.
    """

    task: str = "circle"
    weights: str = ""
