"""Move the tip of an arm and print where it is, over Zenoh and without ROS 2."""

import json
import sys
import time

import zenoh
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
POINT = "geometry_msgs/msg/PointStamped"
POSE = "geometry_msgs/msg/PoseStamped"


def key(topic, kind, domain=0):
    """Name of a topic in Zenoh."""
    package, _, name = kind.split("/")
    return f"{domain}{topic}/{package}::msg::dds_::{name}_/{STORE.hash_rihs01(kind)}"


def show(sample):
    pose = STORE.deserialize_cdr(sample.payload.to_bytes(), POSE).pose
    print("tip", pose.position.x, pose.position.y, pose.position.z, flush=True)


def new(kind, *fields):
    build = STORE.types[kind]
    return build(*fields)


header = new("std_msgs/msg/Header", new("builtin_interfaces/msg/Time", 0, 0), "base")
target = new(POINT, header, new("geometry_msgs/msg/Point", 0.15, 0.05, 0.55))
message = bytes(STORE.serialize_cdr(target, POINT))
endpoint = sys.argv[1] if sys.argv[1:] else "tcp/127.0.0.1:7447"
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with zenoh.open(config) as session:
    tips = session.declare_subscriber(key("/arm/tip_pose", POSE), show)
    for _ in range(50):  # repeat it: a target counts for 2 s
        session.put(key("/arm/target/point", POINT), message)
        time.sleep(0.1)
