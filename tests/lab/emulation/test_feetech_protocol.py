"""Packets of Feetech's protocol, against byte strings of its manual."""

from s2c2a.lab.emulation import feetech_protocol as protocol
from s2c2a.lab.emulation import instructions
from s2c2a.lab.emulation.feetech_protocol import FeetechDecoder, FeetechProtocol, pack
from s2c2a.lab.emulation.instructions import BROADCAST, Instruction
from s2c2a.lab.emulation.servo import MotorState
from s2c2a.lab.emulation.sts3215 import STS3215

answer = FeetechProtocol().answer
PING_1 = bytes.fromhex("FF FF 01 02 01 FB")
PING_STATUS = bytes.fromhex("FF FF 01 02 00 FC")
READ_POSITION = bytes.fromhex("FF FF 01 04 02 38 02 BE")
POSITION_STATUS = bytes.fromhex("FF FF 01 04 00 18 05 DD")


def make_servos(count=2, ticks=1304.0):
    return [STS3215(id, MotorState(ticks=ticks)) for id in range(1, count + 1)]


def decode(data):
    return FeetechDecoder().feed(data, 0.0)


def test_a_ping_has_the_bytes_of_the_manual_and_so_has_its_answer():
    assert pack(1, instructions.PING) == PING_1
    answers = answer(decode(PING_1)[0], make_servos(), 0.0)
    assert [one.data for one in answers] == [PING_STATUS]


def test_a_position_is_read_with_the_bytes_of_the_manual():
    assert pack(1, instructions.READ, b"\x38\x02") == READ_POSITION
    answers = answer(decode(READ_POSITION)[0], make_servos(), 0.0)
    assert answers[0].data == POSITION_STATUS


def test_a_damaged_packet_is_dropped_and_the_next_one_is_read():
    packets = decode(READ_POSITION[:-1] + b"\x00" + PING_1)
    assert packets == [Instruction(1, instructions.PING, b"")]


def test_a_sync_read_is_answered_in_the_order_asked():
    packet = Instruction(BROADCAST, instructions.SYNC_READ, b"\x38\x02\x02\x01")
    answers = answer(packet, make_servos(), 0.0)
    assert [one.id for one in answers] == [2, 1]
    assert answers[1].data == POSITION_STATUS


def test_hardware_errors_are_in_every_answer():
    servo = make_servos(1)[0]
    servo.raise_error("overload")
    assert answer(decode(PING_1)[0], [servo], 0.0)[0].data[4] == 0x20


def test_an_instruction_that_does_not_exist_is_an_error():
    answers = answer(Instruction(1, 0x33, b""), make_servos(), 0.0)
    assert answers[0].data[4] == protocol.INSTRUCTION_ERROR
