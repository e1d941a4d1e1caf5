"""A node of ROS 2 on a Zenoh session of its own."""

import json
import re
import time
import uuid
from collections.abc import Callable
from itertools import count
from typing import Any

from s2c2a.errors import S2C2AError
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.ros.messages import MAX_MESSAGE, encode
from s2c2a.integrations.ros.names import NodeName, Topic, attachment

ENDPOINT = re.compile(r"(tcp|tls|quic)/(?P<host>[^\s/?#]+):(?P<port>\d{1,5})")
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

Publish = Callable[[Any], None]
Receive = Callable[[bytes], None]


class Node:
    """Publishes and subscribes to topics.

    As a client, it has one connection to a router and listens on no port. As a router,
    it listens at the endpoint and connects to nobody. It never searches the network.
    """

    def __init__(self, endpoint: str, domain: int, namespace: str, router: bool):
        """Connect to the router at an endpoint, or be the router there.

        Args:
            endpoint: such as tcp/127.0.0.1:7447.
            domain: ROS_DOMAIN_ID.
            namespace: of the node.
            router: whether this node is the router.

        Raises:
            S2C2AError: the extra is missing, the endpoint is no endpoint, no router
                answers there, or the port is taken.
        """
        check_endpoint(endpoint)
        with needs_extra("ros", "ROS 2"):
            import zenoh  # noqa: PLC0415  # an extra
        self._zenoh = zenoh
        # one way to others, and no search for more
        settings: dict[str, Any] = {
            "mode": "router" if router else "client",
            "listen/endpoints": [endpoint] if router else [],
            "connect/endpoints": [] if router else [endpoint],
            "scouting/multicast/enabled": False,
            "scouting/gossip/autoconnect": {"router": [], "peer": []},
            "transport/link/rx/max_message_size": 16 * MAX_MESSAGE,
        }
        try:
            config = zenoh.Config()
            for name, value in settings.items():
                config.insert_json5(name, json.dumps(value))
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            text = (
                f"no Zenoh router answers at {endpoint}; start one (`ros2 run "
                "rmw_zenoh_cpp rmw_zenohd`), name its --endpoint, or give --router to "
                "be the router"
            )
            if router:
                text = (
                    f"cannot be a router at {endpoint}: is the port taken? If a router "
                    "runs there, leave out --router; otherwise choose another port with "
                    "--endpoint"
                )
            raise S2C2AError(text) from error
        self._numbers = count(1)
        self._name = NodeName(domain, str(self._session.info.zid()), namespace)
        self._kept = [self._declare_token(self._name.token())]

    def publisher(self, topic: Topic) -> Publish:
        """A function that sends a message on a topic; it never waits for receivers."""
        qos = self._zenoh.CongestionControl.DROP
        key = topic.key(self._name.domain)
        sender = self._session.declare_publisher(
            key, encoding="application/cdr", congestion_control=qos
        )
        self._add("MP", topic, sender)
        sequence = count(1)
        identity = uuid.uuid4().bytes

        def publish(message: Any) -> None:
            sent = attachment(next(sequence), time.time_ns(), identity)
            sender.put(encode(topic.type, message), attachment=sent)

        return publish

    def subscribe(self, topic: Topic, receive: Receive) -> None:
        """Call a fast function with the bytes of every message, in another thread.

        Of a message that is too long, it gets the first bytes, one too many.
        """

        def on_sample(sample: Any) -> None:
            receive(sample.payload.to_bytes()[: MAX_MESSAGE + 1])

        key = topic.key(self._name.domain)
        self._add("MS", topic, self._session.declare_subscriber(key, on_sample))

    def close(self) -> None:
        """Leave the graph."""
        self._session.close()

    def _add(self, kind: str, topic: Topic, entity: Any) -> None:
        token = self._name.topic_token(next(self._numbers), kind, topic)
        self._kept += [entity, self._declare_token(token)]

    def _declare_token(self, key: str) -> Any:
        return self._session.liveliness().declare_token(key)


def check_endpoint(endpoint: str) -> None:
    """Raise S2C2AError if a text is not an endpoint of Zenoh over TCP, TLS or QUIC."""
    if not ENDPOINT.fullmatch(endpoint):
        raise S2C2AError(
            f"endpoint '{endpoint}' is not of the form tcp/HOST:PORT; "
            "give one such as tcp/127.0.0.1:7447"
        )


def is_local(endpoint: str) -> bool:
    """Whether only this machine reaches an endpoint."""
    parts = ENDPOINT.fullmatch(endpoint)
    return parts is not None and parts["host"] in LOOPBACK
