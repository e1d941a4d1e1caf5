"""Names of topics and nodes on Zenoh, as rmw_zenoh has them.

Source: "A ROS 2 RMW based on Zenoh", docs/design.md of ros2/rmw_zenoh.
"""

import struct
from dataclasses import dataclass

from s2c2a.integrations.ros.messages import type_hash

NODE_NAME = "s2c2a"
QOS = "::,10:,:,:,,"
"""Quality of service in a token: all defaults of ROS 2 (reliable, volatile, last 10)."""


@dataclass(frozen=True)
class Topic:
    """A topic of one type.

    Attributes:
        name: absolute, such as "/arm/target/point".
        type: such as "geometry_msgs/msg/PointStamped".
    """

    name: str
    type: str

    @property
    def typed(self) -> str:
        """The type and its hash, as parts of a key."""
        package, kind, name = self.type.split("/")
        return f"{package}::{kind}::dds_::{name}_/{type_hash(self.type)}"

    def key(self, domain: int) -> str:
        """Key on which the topic's messages are sent."""
        return f"{domain}/{self.name.lstrip('/')}/{self.typed}"


@dataclass(frozen=True)
class NodeName:
    """A node in the graph of ROS 2.

    Attributes:
        domain: ROS_DOMAIN_ID.
        session: id of the Zenoh session.
        namespace: such as "/arm".
    """

    domain: int
    session: str
    namespace: str

    def token(self) -> str:
        """Liveliness token that shows the node to others."""
        return f"{self._start(0)}/NN/{self._name}"

    def topic_token(self, number: int, kind: str, topic: Topic) -> str:
        """Liveliness token of a publisher ("MP") or subscription ("MS").

        Args:
            number: of the entity, unlike that of any other.
            kind: of the entity.
            topic: that it has.
        """
        name = _mangled(topic.name)
        return f"{self._start(number)}/{kind}/{self._name}/{name}/{topic.typed}/{QOS}"

    def _start(self, number: int) -> str:
        return f"@ros2_lv/{self.domain}/{self.session}/0/{number}"

    @property
    def _name(self) -> str:
        return f"%/{_mangled(self.namespace)}/{NODE_NAME}"


def attachment(sequence: int, moment_ns: int, sender: bytes) -> bytes:
    """What rmw_zenoh attaches to a message.

    Args:
        sequence: number of the message.
        moment_ns: when it was sent, since 1970 [ns].
        sender: id of the publisher, 16 bytes.
    """
    return struct.pack("<qqB", sequence, moment_ns, len(sender)) + sender


def _mangled(name: str) -> str:
    return name.replace("/", "%")
