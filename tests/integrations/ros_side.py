"""The ROS side of a test, by the SDK of another author: `ros_side.py PORT`.

It repeats the target of the last line of its input (JSON), or sends a stop, and prints
what arrives. All
definitions are given, so that the SDK downloads none.
"""

import json
import os
import sys
import threading
import time

from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession
from zenoh_ros2_sdk.utils import get_type_hash

TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
POINT = "float64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
POSE = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
DEFINITIONS = {
    "builtin_interfaces/msg/Time": TIME,
    "std_msgs/msg/Header": HEADER,
    "geometry_msgs/msg/Point": POINT,
    "geometry_msgs/msg/Quaternion": QUATERNION,
    "geometry_msgs/msg/Pose": POSE,
    "geometry_msgs/msg/PointStamped": "std_msgs/Header header\ngeometry_msgs/Point point\n",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
        "float64[] velocity\nfloat64[] effort\n"
    ),
    "std_msgs/msg/Bool": "bool data\n",
}


def options_of(kind, port):
    return {
        "msg_type": kind,
        "msg_definition": DEFINITIONS[kind],
        "type_hash": get_type_hash(kind, DEFINITIONS[kind], DEFINITIONS),
        "domain_id": 0,
        "router_ip": "127.0.0.1",
        "router_port": port,
    }


def write(line):
    """One line in one piece, as several threads write."""
    os.write(sys.stdout.fileno(), (json.dumps(line) + "\n").encode())


def show(topic, arrived):
    stamp = arrived.header.stamp
    line = {"topic": topic, "now": time.time(), "frame": arrived.header.frame_id}
    line["stamp"] = stamp.sec + 1e-9 * stamp.nanosec
    if hasattr(arrived, "pose"):
        position = arrived.pose.position
        line["tip"] = [position.x, position.y, position.z]
    else:
        line["names"] = list(arrived.name)
        line["values"] = arrived.position.tolist()
    write(line)


def main():
    port = int(sys.argv[1])
    session = ZenohSession.get_instance("127.0.0.1", port)
    for name, definition in DEFINITIONS.items():
        session.register_message_type(definition, name)
    types = session.store.types

    def header(frame):
        moment = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
        return types["std_msgs/msg/Header"](stamp=moment, frame_id=frame)

    for topic in ("joint_states", "joint_commands", "tip_pose"):
        kind = "geometry_msgs/msg/PoseStamped"
        if topic.startswith("joint"):
            kind = "sensor_msgs/msg/JointState"
        ROS2Subscriber(
            f"/arm/{topic}",
            callback=lambda arrived, topic=topic: show(topic, arrived),
            **options_of(kind, port),
        )
    target = ROS2Publisher(
        "/arm/target/point", **options_of("geometry_msgs/msg/PointStamped", port)
    )
    stop = ROS2Publisher("/arm/stop", **options_of("std_msgs/msg/Bool", port))
    emergency = ROS2Publisher(
        "/arm/emergency_stop", **options_of("std_msgs/msg/Bool", port)
    )
    current = {}

    def repeat():
        while True:
            if "target" in current:
                x, y, z = current["target"]
                place = types["geometry_msgs/msg/Point"](x=x, y=y, z=z)
                target.publish(header=header(current["frame"]), point=place)
            time.sleep(0.05)

    threading.Thread(target=repeat, daemon=True).start()
    write({"topic": "ready"})
    for line in sys.stdin:
        order = json.loads(line)
        if "stop" in order:
            stop.publish(data=order["stop"])
        elif "emergency" in order:
            emergency.publish(data=True)
        else:
            current.clear()
            current.update(order)
    os._exit(0)  # threads of the SDK would keep a process that nobody needs


if __name__ == "__main__":
    main()
