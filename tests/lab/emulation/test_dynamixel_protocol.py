"""Packets of DYNAMIXEL protocol 2.0, against byte strings of the e-manual."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.emulation import dynamixel_protocol as protocol
from s2c2a.lab.emulation import instructions
from s2c2a.lab.emulation.dynamixel_protocol import (
    DynamixelDecoder,
    DynamixelProtocol,
    pack,
)
from s2c2a.lab.emulation.instructions import BROADCAST, Instruction
from s2c2a.lab.emulation.servo import MotorState
from s2c2a.lab.emulation.xl330 import XL330
from s2c2a.lab.hardware.dynamixel.packets import DynamixelPackets

answer = DynamixelProtocol().answer
PING_1 = bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E")
READ_1 = bytes.fromhex("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15")
HEADER_BYTES = st.lists(st.sampled_from([0xFF, 0xFD, 0x00, 0x55]), max_size=40)


def make_servos(count=2, **state):
    servos = [XL330(id, MotorState(**state)) for id in range(1, count + 1)]
    for servo in servos:
        servo["return_delay"] = 0
    return servos


def decode(data):
    return DynamixelDecoder().feed(data, 0.0)


def word(value):
    return value.to_bytes(2, "little")


@given(
    st.integers(0, 252),
    st.sampled_from([instructions.PING, instructions.READ, instructions.WRITE]),
    HEADER_BYTES.map(bytes),
)
def test_packets_are_those_of_the_driver(id, instruction, parameters):
    packet = pack(id, instruction, parameters)
    assert packet == DynamixelPackets().encode(id, instruction, parameters)
    assert decode(packet) == [Instruction(id, instruction, parameters)]


def test_the_rest_of_a_packet_that_stays_out_is_not_awaited():
    decoder = DynamixelDecoder()
    assert decoder.feed(READ_1[:9], 0.0) == []
    assert len(decoder.feed(PING_1, 1.0)) == 1


def test_a_goal_without_stuffing_is_dropped_and_the_next_packet_is_read():
    body = bytes((instructions.WRITE,)) + word(116) + b"\xff\xff\xfd\xff"
    packet = protocol.HEADER + b"\x01" + word(len(body) + 2) + body
    packet += word(protocol.crc16(packet))
    assert decode(packet + PING_1) == [Instruction(1, instructions.PING, b"")]


def test_a_ping_is_answered_with_model_and_firmware():
    servos = make_servos()
    answers = answer(decode(PING_1)[0], servos, 0.0)
    expected = pack(1, protocol.STATUS, b"\x00" + word(1200) + b"\x34")
    assert [one.data for one in answers] == [expected]


def test_a_wrong_crc_is_answered_with_an_error():
    packet = decode(PING_1[:-1] + b"\x00")[0]
    answers = answer(packet, make_servos(), 0.0)
    assert answers[0].data == pack(1, protocol.STATUS, b"\x03")


@pytest.mark.parametrize(
    ("instruction", "parameters", "code"),
    [
        (instructions.WRITE, word(116) + b"\x00\x02\x00\x00", 0),
        (0x33, b"", 0x02),
        (instructions.WRITE, word(64) + b"\x02", 0x04),
        (instructions.WRITE, word(116) + b"\x00\x02", 0x05),
        (instructions.WRITE, word(116) + b"\x00\x20\x00\x00", 0x06),
        (instructions.WRITE, word(132) + b"\x00\x00\x00\x00", 0x07),
        (instructions.WRITE, word(15) + b"\x00", 0x07),
    ],
)
def test_errors_are_those_of_the_manual(instruction, parameters, code):
    packet = Instruction(1, instruction, parameters)
    answers = answer(packet, make_servos(), 0.0)
    assert answers[0].data == pack(1, protocol.STATUS, bytes((code,)))


def test_a_sync_read_is_answered_in_the_order_asked_up_to_an_absent_servo():
    servos = make_servos(3)
    parameters = word(132) + word(4) + bytes((3, 1, 9, 2))
    answers = answer(
        Instruction(BROADCAST, instructions.SYNC_READ, parameters), servos, 0.0
    )
    assert [one.id for one in answers] == [3, 1]


def test_a_fast_sync_read_is_one_packet_with_a_crc_after_every_part():
    servos = make_servos(2, ticks=166.0)
    parameters = word(132) + word(4) + bytes((1, 2))
    packet = Instruction(BROADCAST, protocol.FAST_SYNC_READ, parameters)
    parts = [one.data for one in answer(packet, servos, 0.0)]
    whole = b"".join(parts)
    start = bytes.fromhex("FF FF FD 00 FE 11 00 55 00 01 A6 00 00 00")
    assert parts[0] == start + word(protocol.crc16(start))
    assert len(whole) == 7 + int.from_bytes(whole[5:7], "little")
    assert whole[-2:] == word(protocol.crc16(whole[:-2]))


def test_a_reboot_is_answered_and_followed_by_silence():
    servo = make_servos(1)[0]
    answers = answer(Instruction(1, instructions.REBOOT, b""), [servo], 2.0)
    assert len(answers) == 1
    assert not servo.is_present(2.2)
    assert servo.is_present(2.4)


def test_the_alert_bit_shows_a_hardware_error():
    servo = make_servos(1)[0]
    servo.raise_error("overload")
    answers = answer(decode(PING_1)[0], [servo], 0.0)
    assert answers[0].data[8] == protocol.ALERT


@pytest.mark.parametrize(("level", "answered"), [(0, 0), (1, 1), (2, 2)])
def test_the_status_return_level_silences_reads_and_writes(level, answered):
    servo = make_servos(1)[0]
    servo["status_return_level"] = level
    read = Instruction(1, instructions.READ, word(132) + word(4))
    write = Instruction(1, instructions.WRITE, word(65) + b"\x01")
    answers = answer(read, [servo], 0.0) + answer(write, [servo], 0.0)
    assert len(answers) == answered


def test_the_return_delay_precedes_an_answer():
    servo = make_servos(1)[0]
    servo["return_delay"] = 250
    answers = answer(decode(PING_1)[0], [servo], 0.0)
    assert answers[0].delay == pytest.approx(0.0005)
