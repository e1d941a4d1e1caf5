"""Command `s2c2a ros`: an arm on the topics of ROS 2."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import tyro

from s2c2a.cli.console import Arm, FidelityName, GuardName, StrategyNames
from s2c2a.cli.dependent_options import effective
from s2c2a.cli.execution import (
    RobotName,
    RobotOptions,
    TrackingSource,
    require,
    robot_factory_for,
)
from s2c2a.live.cli.live import signal_stops, wait_for_interrupt
from s2c2a.robots.factory import RobotFactory
from s2c2a.spaces import Stage

if TYPE_CHECKING:
    from s2c2a.arm import ArmSpec
    from s2c2a.integrations.ros.bridge import RosOptions
    from s2c2a.live.control import ArmControl
    from s2c2a.live.process import ControlProcess


@effective(
    "seed",
    where="with the simulated arm, or a robot class that has a seed",
    holds=lambda given: RobotFactory(given["robot"]).accepts("seed"),
)
def ros(
    arm: tyro.conf.Positional[Arm] = "twin_arm",
    weights: tuple[str, ...] = (),
    strategy: StrategyNames = (),
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    fidelity: FidelityName = "fast",
    guard: GuardName = "tip",
    seed: int = 0,
    endpoint: str = "tcp/127.0.0.1:7447",
    router: bool = False,
    domain: int = 0,
    namespace: str = "/arm",
    frame: str = "base",
    timeout: float = 2.0,
    release_after: float = 10.0,
) -> None:
    """Control an arm from ROS 2, without a ROS installation on this machine.

    The arm follows targets and tasks of topics and publishes its state, over the
    protocol of rmw_zenoh (docs/guides/ros.md). It connects to nothing but the endpoint.

    Args:
        arm: a preset or an arm file.
        weights: files from `s2c2a train`, or "shipped" for the networks of the package;
            the first one drives. By default shipped networks for a preset, and `pcc`
            for an arm of your own.
        strategy: a strategy without training, by name or your own file.py:Class; it
            drives.
        robot: the simulated arm, servos (dynamixel, feetech; docs/guides/hardware.md),
            or your own class, such as my_arm.py:MyArm.
        robot_option: further arguments of that class.
        tracking: source of the poses of a real arm's module ends, such as udp:9763 or
            natnet:192.168.1.10 (docs/guides/tracking.md); by default that of the arm file.
        fidelity: of the simulation.
        guard: what avoids obstacles: the tip, or the whole arm.
        seed: random seed of the simulated noise.
        endpoint: the Zenoh router, or the address on which to be it.
        router: be the router at the endpoint, where none runs.
        domain: ROS_DOMAIN_ID of the other nodes.
        namespace: of the topics.
        frame: id of the base frame in messages.
        timeout: time without a target or task after which the arm holds [s].
        release_after: time after which an arm that is not driven returns to rest [s].
    """
    from s2c2a.integrations.ros.bridge import RosOptions
    from s2c2a.strategies import describe_use, session_of

    require("ros", "zenoh", "rosbags")
    options = RosOptions(endpoint, router, domain, namespace, frame, timeout)
    factory = robot_factory_for(robot, robot_option, fidelity, tracking=tracking)
    for session in map(session_of, weights):
        if session is not None:
            print(describe_use(session))
    control_options: dict[str, Any] = {
        "weights": weights,
        "strategies": strategy,
        "guard": guard,
        "seed": seed,
        "release_after": release_after,
    }
    log = partial(print, flush=True)
    with running_bridge(arm, factory, options, log, **control_options) as control:
        wait_for_interrupt()
    latest = control.latest
    at_rest = latest and latest.stage is Stage.IDLE
    state = "at rest" if at_rest else "check whether it is at rest"
    print(f"{arm} has stopped; {state}.")


@contextmanager
def running_bridge(
    arm: str,
    factory: RobotFactory,
    options: "RosOptions",
    log: Callable[[str], None],
    strategies: tuple[str, ...] = (),
    **control_options: Any,
) -> "Iterator[ControlProcess]":
    """Run the control process of an arm on the topics of ROS 2; close both at the end.

    Args:
        arm: a preset or an arm file.
        factory: the robot.
        options: how the arm appears.
        log: gets lines for the user.
        strategies: without training; the first one drives.
        control_options: of `arm_control`.

    Raises:
        S2C2AError: no router, no networks for this arm, or the arm did not open.
    """
    from s2c2a.arm import load_arm
    from s2c2a.integrations.ros.bridge import bridged, open_node
    from s2c2a.integrations.ros.node import is_local
    from s2c2a.live.process import ControlProcess
    from s2c2a.strategies import STRATEGIES

    spec = load_arm(arm)
    build = partial(
        build_control, spec, factory, strategies=strategies, **control_options
    )
    with ExitStack() as stack:
        node = stack.enter_context(open_node(options))  # an error comes before the arm
        if not is_local(options.endpoint):
            log(f"everybody who reaches {options.endpoint} can move the arm")
        control = ControlProcess(spec, build)
        stack.enter_context(signal_stops(control))
        stack.callback(control.stop)
        log(f"{arm} is being prepared; its first start compiles for a minute or more")
        control.wait_until_ready()
        if strategies:
            control.use(STRATEGIES.named(strategies[0])().name)
        stack.enter_context(bridged(control, node, options, log))
        log(
            f"{arm} is on {options.namespace} of domain {options.domain}; Ctrl-C ends it"
        )
        yield control


def build_control(arm: "ArmSpec", robot: RobotFactory, **options: Any) -> "ArmControl":
    """The control of an arm, in the process that calls it."""
    from s2c2a.live.control import arm_control

    return arm_control(arm, robot, **options)
