"""NatNet messages: bytes worked by hand, and bytes that break their layout."""

import struct

import pytest
from natnet_bytes import (
    BODY,
    DEFINITIONS,
    FRAMES,
    NONE,
    NUMBER,
    ONE,
    SECTIONS_3,
    SECTIONS_41,
    SERVER_INFO,
    SUFFIX_3,
    SUFFIX_4,
    TWO,
    message,
    sized,
)

from s2c2a.lab.tracking import DropReason
from s2c2a.lab.tracking.datagrams import DatagramError
from s2c2a.lab.tracking.natnet.layouts import LAYOUTS, Version
from s2c2a.lab.tracking.natnet.messages import (
    MessageKind,
    RigidBody,
    encode_request,
    parse_definitions,
    parse_frame,
    parse_server_info,
    split_message,
)

VERSIONS = sorted(LAYOUTS)
NOT_FINITE = struct.pack("<d", float("nan")).hex()


def frame(content, version):
    _, reader = split_message(content)
    return parse_frame(reader, LAYOUTS[version])


def definitions(content, version):
    _, reader = split_message(content)
    return parse_definitions(reader, LAYOUTS[version])


@pytest.mark.parametrize("version", VERSIONS)
def test_a_frame_by_hand_has_its_tracked_body(version):
    parsed = frame(FRAMES[version], version)
    assert (parsed.number, parsed.time) == (7, 1.5)
    assert parsed.bodies == (RigidBody(5, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)),)
    assert parsed.models_changed == (version >= (4, 1))


@pytest.mark.parametrize("version", VERSIONS)
def test_the_zero_at_the_end_of_a_frame_may_be_absent(version):
    content = message(7, FRAMES[version][4:-4].hex())
    assert frame(content, version) == frame(FRAMES[version], version)


def test_version_4_0_may_have_the_precise_time():
    parsed = frame(message(7, NUMBER, *SECTIONS_3, *SUFFIX_4), (4, 0))
    assert (parsed.time, parsed.models_changed) == (1.5, True)


@pytest.mark.parametrize("version", VERSIONS)
def test_definitions_by_hand_name_the_body(version):
    assert definitions(DEFINITIONS[version], version) == {5: "base"}


def test_server_info_by_hand_has_version_and_group():
    info = parse_server_info(split_message(SERVER_INFO)[1])
    assert info.version == Version(4, 1)
    assert info.group == ("239.255.42.99", 1511)
    unicast = message(1, SERVER_INFO[4:268].hex())
    assert parse_server_info(split_message(unicast)[1]).group is None


def test_a_request_to_connect_prefers_version_4_1():
    content = encode_request(MessageKind.CONNECT)
    assert content[:8] == b"\0\0\x0f\x01Ping"
    assert content[269:273] == b"\4\1\0\0"
    assert encode_request(MessageKind.KEEP_ALIVE) == b"\x0a\0\1\0\0"


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("parse", [frame, definitions])
def test_every_truncated_message_is_malformed(version, parse):
    content = FRAMES[version][:-4] if parse is frame else DEFINITIONS[version]
    for size in range(4, len(content)):
        with pytest.raises(DatagramError) as caught:
            parse(message(7, content[4:size].hex()), version)
        assert caught.value.reason is DropReason.MALFORMED


def sections_41_with(bodies):
    return (*SECTIONS_41[:2], bodies, *SECTIONS_41[3:])


@pytest.mark.parametrize(
    ("version", "content", "reason"),
    [
        ((3, 1), ("ff ff ff ff", *SECTIONS_3[1:], *SUFFIX_3), "MALFORMED"),
        ((3, 1), (NONE, NONE, TWO, BODY, BODY, *[NONE] * 4, *SUFFIX_3), "MALFORMED"),
        ((3, 1), (NONE, NONE, ONE, BODY, *[NONE] * 5, *SUFFIX_3), "MALFORMED"),
        ((4, 1), (*sections_41_with(sized(TWO, BODY)), *SUFFIX_4), "MALFORMED"),
        ((3, 1), (*SECTIONS_3, SUFFIX_3[0], NOT_FINITE, *SUFFIX_3[2:]), "IMPLAUSIBLE"),
    ],
    ids=["count", "body twice", "section too many", "size for the count", "time"],
)
def test_impossible_frames_are_dropped(version, content, reason):
    with pytest.raises(DatagramError) as caught:
        frame(message(7, NUMBER, *content), version)
    assert caught.value.reason is DropReason[reason]


def test_an_id_with_two_names_is_malformed():
    two = DEFINITIONS[3, 1][8:]
    other = two.replace(b"base\0", b"tip1\0")
    count = struct.pack("<I", 8)
    content = message(5, (count + two + other).hex())
    with pytest.raises(DatagramError, match="two names"):
        definitions(content, (3, 1))
