"""Packets of the DYNAMIXEL protocol: bytes of the manual, and damaged streams."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.hardware.dynamixel.packets import (
    REBOOT,
    STATUS,
    DynamixelPackets,
    crc16,
    unstuffed,
)
from s2c2a.lab.hardware.packets import (
    BROADCAST,
    PING,
    READ,
    SYNC_WRITE,
    WRITE,
    Answer,
)

packets = DynamixelPackets()
encode = packets.encode


def status(id, data=b"", error=0):
    """The bytes of a servo's answer."""
    return encode(id, STATUS, bytes([error]) + data)


def read(stream, size=64):
    """All packets in a stream that arrives in pieces."""
    reader = packets.reader()
    found = []
    for start in range(0, len(stream), size):
        found += reader.feed(stream[start : start + size])
    return [*found, *reader.flush()]


@pytest.mark.parametrize(
    ("packet", "expected"),
    [
        ((1, PING), "ff ff fd 00 01 03 00 01 19 4e"),
        (
            (1, READ, bytes.fromhex("84 00 04 00")),
            "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15",
        ),
        (
            (1, WRITE, bytes.fromhex("74 00 00 02 00 00")),
            "ff ff fd 00 01 09 00 03 74 00 00 02 00 00 ca 89",
        ),
        ((1, REBOOT), "ff ff fd 00 01 03 00 08 2f 4e"),
    ],
)
def test_instructions_are_those_of_the_manual(packet, expected):
    assert encode(*packet) == bytes.fromhex(expected)


def test_the_answer_to_a_ping_is_that_of_the_manual():
    stream = bytes.fromhex("ff ff fd 00 01 07 00 55 00 06 04 26 65 5d")
    assert read(stream) == [Answer(1, 0, b"\x06\x04\x26")]


@given(st.binary(max_size=200))
def test_the_checksum_is_that_of_the_manufacturer(data):
    sdk = pytest.importorskip("dynamixel_sdk")
    handler = sdk.PacketHandler(2.0)
    assert crc16(data) == handler.updateCRC(0, data, len(data))


HEADER_BYTES = st.lists(st.sampled_from([0xFF, 0xFD, 0x00, 0x55]), max_size=40)


@given(HEADER_BYTES.map(bytes), st.integers(0, 252), st.integers(0, 255))
def test_stuffing_is_taken_out_again(data, id, error):
    assert read(status(id, data, error)) == [Answer(id, error, data)]


@given(HEADER_BYTES.map(bytes))
def test_stuffing_is_that_of_the_manufacturer(data):
    sdk = pytest.importorskip("dynamixel_sdk")
    raw = bytes([BROADCAST, len(data) + 3, 0, SYNC_WRITE]) + data
    packet = [0xFF, 0xFF, 0xFD, 0, *raw, 0, 0]
    packet = sdk.PacketHandler(2.0).addStuffing(packet)
    ours = encode(BROADCAST, SYNC_WRITE, data)
    assert bytes(packet[7:-2]) == ours[7:-2]


def test_unstuffing_leaves_other_bytes_alone():
    data = bytes.fromhex("ff ff fd 00 fd fd ff fd fd")
    assert unstuffed(data) == data


@pytest.mark.parametrize("place", range(len(status(1, bytes(3)))))
def test_packets_behind_a_damaged_byte_survive(place):
    damaged = bytearray(status(1, bytes(3)))
    damaged[place] ^= 0x7F
    stream = bytes(damaged) + status(2, b"\x01") + status(3, b"\x02")
    assert [packet.id for packet in read(stream, 1)][-2:] == [2, 3]


def test_a_damaged_length_is_skipped_before_more_bytes_come():
    damaged = bytearray(status(1, bytes(3)))
    damaged[6] = 1  # a length of 256 bytes more
    reader = packets.reader(max_length=40)
    found = list(reader.feed(bytes(damaged) + status(2)))
    assert [packet.id for packet in found] == [2]
