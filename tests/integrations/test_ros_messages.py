"""Messages of ROS 2: bytes, changes of the request, snapshots, names on Zenoh."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.integrations.ros.bridge import RosOptions
from s2c2a.integrations.ros.inputs import ADD, DELETE_ALL, SPHERE, Inputs
from s2c2a.integrations.ros.messages import (
    DIAGNOSTICS,
    JOINTS,
    MARKERS,
    MAX_MESSAGE,
    POINT,
    POSE,
    SWITCH,
    TEXT,
    MessageError,
    decode,
    encode,
    header_of,
    new,
    type_hash,
    type_store,
)
from s2c2a.integrations.ros.names import NodeName, Topic
from s2c2a.integrations.ros.outputs import CUBE, LINE_STRIP, Outputs, turn_to
from s2c2a.live.request import MAX_OBSTACLES, Obstacle, Request, RequestLimits
from s2c2a.obstacles import turned

pytest.importorskip("rosbags")
NOW = 1_800_000_000.0
PUBLISHED_HASH = (
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
)
"""Of std_msgs/msg/String, in the design of rmw_zenoh."""


@pytest.fixture
def limits(twin):
    return RequestLimits.of(twin, ("circle", "square"))


@pytest.fixture
def inputs(limits):
    return Inputs(limits, "base", lambda: NOW)


@pytest.fixture
def outputs(twin):
    return Outputs(twin, "base")


def vector(kind, *values):
    return new(f"geometry_msgs/msg/{kind}", **dict(zip("xyzw", values, strict=False)))


def point_message(*place, frame="base", moment=0.0):
    return new(POINT, header=header_of(frame, moment), point=vector("Point", *place))


def pose_message(place, turn):
    pose = new(
        "geometry_msgs/msg/Pose",
        position=vector("Point", *place),
        orientation=vector("Quaternion", *turn),
    )
    return new(POSE, header=header_of("base", 0.0), pose=pose)


def spheres(outputs, snapshot, *obstacles):
    """A message of obstacles, from what the arm itself publishes."""
    request = Request(obstacles=obstacles)
    shown = outputs.markers(snapshot, request, NOW).markers
    return new(MARKERS, markers=shown[len(shown) - len(obstacles) :])


def test_bytes_are_those_of_the_standard():
    # CDR, little-endian: stamp, length and text with its zero, then aligned doubles
    worked = b"\0\1\0\0" + struct.pack("<iII5s7x3d", 3, 5, 5, b"base\0", 1.0, 2.0, 3.0)
    message = decode(POINT, worked)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 5)
    assert message.header.frame_id == "base"
    assert (message.point.x, message.point.y, message.point.z) == (1.0, 2.0, 3.0)
    assert encode(POINT, message) == worked
    assert encode(SWITCH, new(SWITCH, data=True)) == b"\0\1\0\0\1"


def test_names_are_those_of_rmw_zenoh():
    assert type_hash(TEXT) == PUBLISHED_HASH
    topic = Topic("/arm/task", TEXT)
    typed = f"std_msgs::msg::dds_::String_/{PUBLISHED_HASH}"
    assert topic.key(3) == f"3/arm/task/{typed}"
    node = NodeName(3, "ab12", "/arm")
    assert node.token() == "@ros2_lv/3/ab12/0/0/NN/%/%arm/s2c2a"
    assert node.topic_token(7, "MS", topic) == (
        f"@ros2_lv/3/ab12/0/7/MS/%/%arm/s2c2a/%arm%task/{typed}/::,10:,:,:,,"
    )


@pytest.mark.parametrize(
    "payload", [b"", b"\0\1\0\0", b"\xff" * 60, b"\0\1\0\0" + b"\xff" * 60]
)
@pytest.mark.parametrize("kind", [POINT, POSE, MARKERS, TEXT, SWITCH])
def test_bytes_that_are_no_message_are_refused(kind, payload):
    if kind == SWITCH and len(payload) > 4:
        return
    with pytest.raises(MessageError, match="it is no"):
        decode(kind, payload)


def test_a_message_that_is_too_long_is_refused():
    with pytest.raises(MessageError, match=r"65537 bytes; at most 65536 are read"):
        decode(TEXT, bytes(MAX_MESSAGE + 1))


def test_a_point_is_a_target_without_an_axis(inputs):
    changes = inputs.point(point_message(0.1, 0.2, 0.4, moment=NOW))
    assert changes["target"] == (0.1, 0.2, 0.4)
    assert changes["axis"] is changes["task"] is None


def test_the_z_axis_of_a_pose_is_the_end_axis(inputs):
    half = np.sqrt(0.5)  # a quarter turn about y takes z to x
    changes = inputs.pose(pose_message((0.1, 0.0, 0.4), (0.0, half, 0.0, half)))
    np.testing.assert_allclose(changes["axis"], (1.0, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (lambda: point_message(np.nan, 0.0, 0.4), "not all finite"),
        (lambda: point_message(0.0, np.inf, 0.4), "not all finite"),
        (lambda: point_message(0.0, 0.0, 400.0), "the unit is the meter"),
        (lambda: point_message(0, 0, 0.4, frame=""), "its frame is ''; transform"),
        (lambda: point_message(0, 0, 0.4, frame="map"), "transform it to 'base'"),
        (lambda: point_message(0, 0, 0.4, moment=NOW - 5), r"its stamp is 5\.0 s old"),
    ],
)
def test_a_target_that_does_not_fit_is_refused(inputs, message, reason):
    with pytest.raises(MessageError, match=reason):
        inputs.point(message())


@pytest.mark.parametrize("turn", [(0, 0, 0, 0), (0, 0, 0, 2), (0, 0, 0, np.nan)])
def test_an_orientation_that_is_none_is_refused(inputs, turn):
    with pytest.raises(MessageError, match="no unit quaternion"):
        inputs.pose(pose_message((0.1, 0.0, 0.4), turn))


def test_published_obstacles_are_read_again(inputs, outputs, snapshot):
    obstacles = (Obstacle((0.2, 0.0, 0.3), 0.05), Obstacle((0.0, 0.3, 0.3), 0.1))
    message = spheres(outputs, snapshot, *obstacles)
    arrived = decode(MARKERS, encode(MARKERS, message))
    assert inputs.obstacles(arrived)["obstacles"] == obstacles
    assert inputs.obstacles(new(MARKERS, markers=[]))["obstacles"] == ()


def test_obstacles_beyond_reach_are_left_out_instead_of_moved(
    inputs, outputs, snapshot, limits
):
    far = Obstacle((2 * limits.reach, 0.0, 0.0), 0.05)
    message = spheres(outputs, snapshot, far)
    assert inputs.obstacles(message)["obstacles"] == ()


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("type", 1, "each as SPHERE"),
        ("action", 2, "each as SPHERE"),
        ("scale", vector("Vector3", 0.1, 0.1, 0.2), "three equal diameters"),
        ("scale", vector("Vector3", 9.0, 9.0, 9.0), "three equal diameters"),
        ("scale", vector("Vector3", 0.0, 0.0, 0.0), "three equal diameters"),
        ("scale", vector("Vector3", np.nan, 0.1, 0.1), "not all finite"),
        ("header", header_of("map", 0.0), "its frame is 'map'"),
    ],
)
def test_an_obstacle_that_is_no_sphere_is_refused(
    inputs, outputs, snapshot, field, value, reason
):
    message = spheres(outputs, snapshot, Obstacle((0.2, 0.0, 0.3), 0.05))
    setattr(message.markers[0], field, value)
    with pytest.raises(MessageError, match=reason):
        inputs.obstacles(message)


def test_too_many_obstacles_are_refused(inputs, outputs, snapshot):
    ball = Obstacle((0.2, 0.0, 0.3), 0.05)
    message = spheres(outputs, snapshot, *[ball] * (MAX_OBSTACLES + 1))
    with pytest.raises(MessageError, match="17 obstacles; at most 16"):
        inputs.obstacles(message)


def test_a_task_plays_and_an_empty_one_ends_it(inputs):
    assert inputs.task(new(TEXT, data="circle")) == {"task": "circle", "playing": True}
    assert inputs.task(new(TEXT, data="")) == {"task": None, "playing": False}
    with pytest.raises(MessageError, match=r"no task 'cirle'.*circle.*choose one of"):
        inputs.task(new(TEXT, data="cirle"))


def test_a_snapshot_becomes_joints_a_pose_and_bends(outputs, snapshot, twin):
    joints = outputs.cables(snapshot.step.reading.sensors["cables"], 1.5)
    joints = decode(JOINTS, encode(JOINTS, joints))
    assert (joints.header.stamp.sec, joints.header.stamp.nanosec) == (1, 500_000_000)
    assert joints.name[3:5] == ["module_2_cable_1", "module_2_cable_2"]
    assert joints.position.tolist() == list(range(9))
    assert joints.velocity.size == joints.effort.size == 0
    tip = outputs.tip(snapshot, 0.0)
    assert tip.header.frame_id == "base"
    assert tip.pose.position.z == pytest.approx(twin.length)
    assert tip.pose.orientation.w == pytest.approx(1.0)
    assert outputs.bends(snapshot, 0.0).position.tolist() == [0.0] * 6


def test_a_bend_about_one_axis_is_published_in_radians(outputs, snapshot):
    states = np.array(snapshot.states)
    angle = 0.7
    states[:, 3:] = np.sin(angle), 0.0, np.cos(angle)  # all of the bend in module 1
    message = outputs.bends(replace(snapshot, states=states), 0.0)
    assert message.name[:2] == ["module_1_bend_x", "module_1_bend_y"]
    np.testing.assert_allclose(message.position, [0.7, 0, 0, 0, 0, 0], atol=1e-9)


def test_forces_are_efforts():
    arm = load_arm("simulated_arm")
    outputs = Outputs(arm, "base")
    message = outputs.cables(np.ones((arm.module_count, arm.cable_count)), 0.0)
    assert message.position.size == 0
    assert message.effort.tolist() == [1.0] * len(message.name)


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0.6, 0, -0.8), (0, 0, -1)])
def test_the_orientation_of_the_tip_turns_z_to_its_axis(axis):
    turn = turn_to(np.array(axis, dtype=float))
    z = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(turned(z, turn[:3], turn[3:]), axis, atol=1e-12)


def test_markers_show_arm_target_and_obstacles(outputs, snapshot):
    request = Request(target=(0.1, 0.0, 0.5), obstacles=(Obstacle((0, 0, 0.2), 0.1),))
    message = outputs.markers(snapshot, request, NOW)
    markers = decode(MARKERS, encode(MARKERS, message)).markers
    assert [marker.action for marker in markers] == [3, 0, 0, 0, 0]
    assert [marker.type for marker in markers[1:]] == [4, 2, 2, 2]
    assert markers[1].points[-1].z == pytest.approx(snapshot.tip[2])
    assert markers[3].pose.position.x == pytest.approx(0.1)
    # no preset states a radius: the arm ends at its cables
    sizes = [marker.scale.x for marker in markers[1:]]
    assert sizes == pytest.approx([2 * 0.027, *[2.5 * 0.027] * 2, 0.2])
    assert len({marker.id for marker in markers}) == len(markers)


@pytest.mark.parametrize(
    ("fault", "stopped_by", "level"), [("", "", 0), ("", "a hand", 1), ("hot", "", 2)]
)
def test_the_status_has_a_level(outputs, snapshot, fault, stopped_by, level):
    faulty = replace(snapshot, fault=fault)
    message = outputs.status(faulty, {"stopped_by": stopped_by}, NOW)
    status = decode(DIAGNOSTICS, encode(DIAGNOSTICS, message)).status[0]
    assert status.level == level
    values = {pair.key: pair.value for pair in status.values}
    assert values["stage"] == "running"
    assert values["tip_error_m"] == "0.01"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"endpoint": "127.0.0.1:7447"}, "not of the form tcp/HOST:PORT"),
        ({"endpoint": "tcp/a:1#iface=eth0"}, "not of the form tcp/HOST:PORT"),
        ({"domain": 233}, "give 0 to 232"),
        ({"namespace": "arm"}, "not one of ROS 2"),
        ({"namespace": "/arm/*"}, "not one of ROS 2"),
        ({"frame": ""}, "no name"),
        ({"timeout": 0.0}, "positive and finite"),
        ({"timeout": np.nan}, "positive and finite"),
    ],
)
def test_options_that_do_not_fit_are_refused(options, reason):
    with pytest.raises(S2C2AError, match=reason):
        RosOptions(**options)


def test_the_constants_are_those_of_the_definitions():
    marker = type_store().types["visualization_msgs/msg/Marker"]
    assert (marker.SPHERE, marker.ADD, marker.DELETEALL) == (SPHERE, ADD, DELETE_ALL)
    assert (marker.CUBE, marker.LINE_STRIP) == (CUBE, LINE_STRIP)
