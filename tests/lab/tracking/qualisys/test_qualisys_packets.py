"""Packets of QTM: bytes worked by hand, and bytes that break their layout."""

import struct

import numpy as np
import pytest

from s2c2a.lab.tracking.datagrams import DatagramError, DropReason
from s2c2a.lab.tracking.poses import PoseError
from s2c2a.lab.tracking.qualisys.packets import (
    MAX_PACKET,
    PacketKind,
    PacketStream,
    StreamParameters,
    body_pose,
    encode_command,
    parse_frame,
    parse_parameters,
    quaternion,
)

NAN = float("nan")
# 90 deg about z, column by column: x becomes y, y becomes -x
TURN = (0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
BODY = (100.0, 200.0, -300.0, *TURN)
QUARTER = np.sqrt(0.5)


def component(*bodies, kind=5):
    content = struct.pack("<IHH", len(bodies), 0, 0)
    content += b"".join(struct.pack("<12f", *body) for body in bodies)
    return struct.pack("<II", 8 + len(content), kind) + content


def frame(*components, count=None):
    count = len(components) if count is None else count
    return struct.pack("<qII", 1_500_000, 7, count) + b"".join(components)


def test_a_frame_by_hand_has_time_number_and_bodies():
    parsed = parse_frame(frame(component(BODY, (NAN,) * 12)))
    assert (parsed.time, parsed.number) == (1.5, 7)
    assert parsed.bodies == (BODY, None)


def test_other_components_are_skipped():
    parsed = parse_frame(frame(component(kind=1), component(BODY)))
    assert parsed.bodies == (BODY,)


@pytest.mark.parametrize(
    ("up", "position", "rotation"),
    [
        ("+z", [0.1, 0.2, -0.3], [0, 0, QUARTER, QUARTER]),
        ("+y", [0.1, 0.3, 0.2], [0, -QUARTER, 0, QUARTER]),
    ],
)
def test_millimeters_become_meters_and_columns_a_quaternion(up, position, rotation):
    pose = body_pose(BODY, up)
    np.testing.assert_allclose(pose.position, position)
    np.testing.assert_allclose(pose.rotation, rotation, atol=1e-12)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((3, 3)),
        np.diag([1.0, 1.0, -1.0]),
        1.1 * np.eye(3),
        np.full((3, 3), np.nan),
        np.full((3, 3), 1e30),
        np.eye(3) + 0.1 * np.eye(3, k=1),
    ],
)
def test_what_is_no_rotation_is_refused(matrix):
    with pytest.raises(PoseError, match="no rotation matrix"):
        quaternion(matrix)


def test_every_truncated_frame_is_malformed():
    content = frame(component(BODY, BODY))
    for size in range(len(content)):
        with pytest.raises(DatagramError) as caught:
            parse_frame(content[:size])
        assert caught.value.reason is DropReason.MALFORMED


@pytest.mark.parametrize(
    "content",
    [
        frame(component(BODY)) + b"\0",
        frame(),
        frame(component(BODY, kind=6)),
        frame(component(BODY), count=2**32 - 1),
        frame(struct.pack("<II", 0, 5)),
    ],
)
def test_impossible_frames_are_malformed(content):
    with pytest.raises(DatagramError) as caught:
        parse_frame(content)
    assert caught.value.reason is DropReason.MALFORMED


def test_a_command_ends_with_zero():
    assert encode_command("Stop") == b"\x0d\0\0\0\1\0\0\0Stop\0"


def test_packets_are_found_in_single_bytes():
    stream = PacketStream()
    data = encode_command("a") + encode_command("b")
    packets = [packet for byte in data for packet in stream.feed(bytes([byte]))]
    assert packets == [(PacketKind.COMMAND, b"a\0"), (PacketKind.COMMAND, b"b\0")]


@pytest.mark.parametrize(
    ("size", "kind"), [(0, 1), (7, 1), (MAX_PACKET + 1, 3), (8, 9)]
)
def test_an_impossible_header_ends_the_connection(size, kind):
    with pytest.raises(DatagramError):
        PacketStream().feed(struct.pack("<II", size, kind))


def parameters(bodies, up="<The_3D><AxisUpwards>+Z</AxisUpwards></The_3D>"):
    root = "QTM_Parameters_Ver_1.20"
    names = "".join(f"<Body><Name>{name}</Name></Body>" for name in bodies)
    return f"<{root}>{up}<The_6D>{names}</The_6D></{root}>\0".encode()


def test_parameters_name_the_bodies_in_order_and_none_that_two_have():
    parsed = parse_parameters(parameters(["b", "a", "c", "a"]))
    assert parsed == StreamParameters(("b", "", "c", ""), "+z")
    assert parse_parameters(parameters(["a"], up="")).up == "+z"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"<a>",
        b"<other/>",
        b'<!DOCTYPE a [<!ENTITY b "c">]><QTM_Parameters>&b;</QTM_Parameters>',
        b'<?xml version="1.0" encoding="no"?><QTM_Parameters/>\xff',
        parameters(["a"] * 1001),
    ],
)
def test_other_xml_is_malformed(content):
    with pytest.raises(DatagramError) as caught:
        parse_parameters(content)
    assert caught.value.reason is DropReason.MALFORMED
