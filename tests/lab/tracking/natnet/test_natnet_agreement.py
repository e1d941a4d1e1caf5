"""The reader agrees with the package natnet on emulated messages."""

import numpy as np
import pytest
from streams import POSES

from s2c2a.lab.emulation import natnet_protocol
from s2c2a.lab.emulation.natnet_protocol import StreamedBody
from s2c2a.lab.tracking.natnet.layouts import LAYOUTS, Version
from s2c2a.lab.tracking.natnet.messages import (
    parse_definitions,
    parse_frame,
    parse_server_info,
    split_message,
)

natnet = pytest.importorskip("natnet")
packet_buffer = pytest.importorskip("natnet.packet_buffer")

BODIES = {name: StreamedBody(pose, name == "end-1") for name, pose in POSES.items()}


def read(kind, content, version):
    buffer = packet_buffer.PacketBuffer(content[4:])
    return kind.read_from_buffer(buffer, natnet.Version.from_str(version))


@pytest.mark.parametrize("version", ["3.1", "4.0", "4.1"])
def test_frames_names_and_versions_agree(version):
    content = natnet_protocol.encode_frame(version, 7, 1.5, BODIES)
    theirs = read(natnet.DataFrame, content, version)
    layout = LAYOUTS[Version(*natnet_protocol.numbers(version))]
    ours = parse_frame(split_message(content)[1], layout)
    tracked = [body for body in theirs.rigid_bodies if body.tracking_valid]
    assert ours.number == theirs.prefix.frame_number
    assert ours.time == theirs.suffix.timestamp
    assert [body.id for body in ours.bodies] == [body.id_num for body in tracked]
    for own, other in zip(ours.bodies, tracked, strict=True):
        np.testing.assert_array_equal(own.position, other.pos)
        np.testing.assert_array_equal(own.rotation, other.rot)
    content = natnet_protocol.encode_definitions(version, list(POSES))
    theirs = read(natnet.DataDescriptions, content, version)
    names = {body.id_num: body.name for body in theirs.rigid_bodies}
    assert parse_definitions(split_message(content)[1], layout) == names
    content = natnet_protocol.encode_server_info(version, 1511, "")
    stated = read(natnet.ServerInfo, content, version).nat_net_protocol_version
    ours = parse_server_info(split_message(content)[1]).version
    assert ours == (stated.major, stated.minor)
