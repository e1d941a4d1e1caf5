"""An arm on the topics of ROS 2, until the block ends."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass

from s2c2a.errors import S2C2AError
from s2c2a.integrations.ros.driver import RosDriver
from s2c2a.integrations.ros.inputs import Inputs
from s2c2a.integrations.ros.node import Node, check_endpoint
from s2c2a.integrations.ros.outputs import Outputs
from s2c2a.integrations.ros.reporter import Reporter
from s2c2a.live.snapshot import Control

MAX_DOMAIN = 232  # of ROS 2 ("The ROS_DOMAIN_ID"): beyond, DDS has no ports
NAMESPACE = re.compile(r"(/[A-Za-z][A-Za-z0-9_]*)+")


@dataclass(frozen=True)
class RosOptions:
    """How an arm appears in ROS 2.

    Attributes:
        endpoint: of the Zenoh router.
        router: whether this process is the router.
        domain: ROS_DOMAIN_ID.
        namespace: of the topics.
        frame: id of the base frame.
        timeout: time without a target or task until nobody drives [s].

    Raises:
        S2C2AError: an option is not valid.
    """

    endpoint: str = "tcp/127.0.0.1:7447"
    router: bool = False
    domain: int = 0
    namespace: str = "/arm"
    frame: str = "base"
    timeout: float = 2.0  # two periods of `ros2 topic pub` without --rate

    def __post_init__(self):
        """Check the options."""
        check_endpoint(self.endpoint)
        if not 0 <= self.domain <= MAX_DOMAIN:
            raise S2C2AError(
                f"domain {self.domain} is not one of ROS 2; give 0 to {MAX_DOMAIN}"
            )
        if not NAMESPACE.fullmatch(self.namespace):
            raise S2C2AError(
                f"namespace '{self.namespace}' is not one of ROS 2; begin each part with "
                "a slash and a letter, and go on with letters, digits and _, as in "
                "/lab/arm"
            )
        if not self.frame:
            raise S2C2AError("the frame has no name; give one such as base")
        if not 0.0 < self.timeout < float("inf"):
            raise S2C2AError(
                f"a timeout of {self.timeout} s; it must be positive and finite"
            )


def open_node(options: RosOptions) -> AbstractContextManager[Node]:
    """A node on the network of the options, closed at the end.

    Raises:
        S2C2AError: see `Node`.
    """
    node = Node(options.endpoint, options.domain, options.namespace, options.router)
    return closing(node)


@contextmanager
def bridged(
    control: Control, node: Node, options: RosOptions, log: Callable[[str], None]
) -> Iterator[RosDriver]:
    """Let ROS 2 drive a running control; the block ends with the arm at rest.

    Until then, topics show how it goes there, and an emergency stop is obeyed.

    Args:
        control: of the arm; it runs.
        node: of `open_node`.
        options: the same as of the node.
        log: gets lines for the user.
    """
    inputs = Inputs(control.limits, options.frame, time.time)
    outputs = Outputs(control.arm, options.frame)
    with ExitStack() as stack:
        driver = RosDriver(control, inputs, options.timeout, log)
        reporter = Reporter(
            control, outputs, node, options.namespace, lambda: driver.refused, log
        )
        stack.callback(reporter.close)
        stack.callback(control.stop)
        stack.callback(driver.close)
        driver.subscribe(node, options.namespace)
        yield driver
