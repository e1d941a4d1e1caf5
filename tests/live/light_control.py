"""A control without networks, for tests of the process that it runs in."""

from functools import partial

from s2c2a.arm import load_arm
from s2c2a.live.control import ArmControl
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.strategies.pcc import PlainPCC


def light_control(release_after=60.0) -> ArmControl:
    """Control of the simulated twin by `pcc`, which compiles quickly."""
    arm = load_arm("twin_arm")
    return ArmControl(
        SimulatedRobot(arm), {"pcc": partial(light_strategy, arm)}, {}, release_after
    )


def light_strategy(arm):
    """`pcc` as in the recipe `best`."""
    return PlainPCC().build(arm, recipe_named("best"), None, RunOptions())
