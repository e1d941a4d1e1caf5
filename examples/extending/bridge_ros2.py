"""Send a PoseStamped topic of ROS 2 for each body to S2C2A.

    python bridge_ros2.py 9763 base=/base/pose end-1=/end_1/pose     # port, BODY=TOPIC

A datagram has the newest pose of every body; one without a new pose is lost.
"""

import itertools
import json
import socket
import sys
from functools import partial

try:
    import rclpy
    from geometry_msgs.msg import PoseStamped
except ImportError:
    sys.exit(
        "rclpy or geometry_msgs is missing; run `source setup.bash` of ROS 2 first"
    )

port, *pairs = sys.argv[1:]
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
frames = itertools.count()
bodies = {}


def flush(moment):
    message = {"time": moment, "frame": next(frames), "bodies": bodies}
    sender.sendto(json.dumps(message).encode(), ("127.0.0.1", int(port)))
    bodies.clear()


def receive(name, message):
    stamp = message.header.stamp
    moment = stamp.sec + 1e-9 * stamp.nanosec
    if name in bodies:  # it comes again before another one came
        flush(moment)
    p, q = message.pose.position, message.pose.orientation
    bodies[name] = {"position": [p.x, p.y, p.z], "rotation": [q.x, q.y, q.z, q.w]}
    if len(bodies) == len(pairs):
        flush(moment)


rclpy.init()
node = rclpy.create_node("s2c2a_bridge")
for name, topic in (pair.split("=") for pair in pairs):
    node.create_subscription(PoseStamped, topic, partial(receive, name), 10)
rclpy.spin(node)
