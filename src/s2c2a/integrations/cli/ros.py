"""Command `s2c2a ros`: an arm on the topics of ROS 2."""

from contextlib import ExitStack
from functools import partial

import tyro

from s2c2a.cli.console import Arm, StrategyNames
from s2c2a.cli.execution import require
from s2c2a.live.cli.driven_arm import (
    SIMULATED_ARM,
    DrivenArm,
    print_end,
    print_remarks,
    seed_where_used,
)
from s2c2a.live.cli.live import (
    PREPARING,
    import_and_call,
    signal_stops,
    wait_for_interrupt,
)


@seed_where_used
def ros(
    arm: tyro.conf.Positional[Arm] = "twin_arm",
    strategy: StrategyNames = (),
    driven: DrivenArm = SIMULATED_ARM,
    endpoint: str = "tcp/127.0.0.1:7447",
    router: bool = False,
    domain: int = 0,
    namespace: str = "/arm",
    frame: str = "base",
    timeout: float = 2.0,
) -> None:
    """Control an arm from ROS 2, without a ROS installation on this machine.

    The arm follows targets and tasks of topics and publishes its state, over the
    protocol of rmw_zenoh (docs/guides/ros.md). It connects to nothing but the endpoint.

    Args:
        arm: a preset or an arm file.
        strategy: a strategy without training, by name or your own file.py:Class; it
            drives.
        driven: robot, weights and control.
        endpoint: the Zenoh router, or the address on which to be it.
        router: be the router at the endpoint, where none runs.
        domain: ROS_DOMAIN_ID of the other nodes.
        namespace: of the topics.
        frame: id of the base frame in messages.
        timeout: time without a target or task after which the arm holds [s].
    """
    from s2c2a.arm import load_arm
    from s2c2a.integrations.ros.bridge import RosOptions, bridged, open_node
    from s2c2a.integrations.ros.node import is_local
    from s2c2a.live.process import ControlProcess
    from s2c2a.strategies import strategy_named

    require("ros", "zenoh", "rosbags")
    options = RosOptions(
        endpoint=endpoint,
        router=router,
        domain=domain,
        namespace=namespace,
        frame=frame,
        timeout=timeout,
    )
    factory = driven.factory()
    print_remarks(driven.weights)
    log = partial(print, flush=True)
    log(PREPARING.format(arm))
    spec = load_arm(arm)
    build = partial(
        import_and_call,
        "s2c2a.live.control:arm_control",
        spec,
        factory,
        **driven.control_options(strategy),
    )
    with ExitStack() as stack:
        node = stack.enter_context(open_node(options))  # an error comes before the arm
        if not is_local(endpoint):
            log(f"everybody who reaches {endpoint} can move the arm")
        control = ControlProcess(spec, build)
        stack.enter_context(signal_stops(control))
        stack.callback(control.stop)
        control.wait_until_ready()
        if strategy:
            control.use(strategy_named(strategy[0]).name)
        stack.enter_context(bridged(control, node, options, log))
        log(f"{arm} is on {namespace} of domain {domain}; Ctrl-C ends it")
        wait_for_interrupt()
    print_end(arm, control)
