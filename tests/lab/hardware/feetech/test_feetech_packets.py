"""Packets and values against bytes worked by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.hardware.bus import BusError
from s2c2a.lab.hardware.feetech.packets import FeetechPackets
from s2c2a.lab.hardware.feetech.tables import REGISTERS

packets = FeetechPackets()
SIGNED = REGISTERS["goal_position"]
ANSWER = bytes.fromhex("ff ff 01 04 00 18 05 dd")  # 1304 ticks, of the manual's form


@pytest.mark.parametrize(
    ("value", "data"),
    [
        (0, "00 00"),
        (1, "01 00"),
        (-1, "01 80"),
        (4096, "00 10"),
        (32_767, "ff 7f"),
        (-32_767, "ff ff"),
    ],
)
def test_a_position_is_sign_and_magnitude(value, data):
    assert SIGNED.encode(value) == bytes.fromhex(data)
    assert SIGNED.decode(bytes.fromhex(data)) == value


def test_negative_zero_is_zero():
    assert SIGNED.decode(bytes.fromhex("00 80")) == 0


@given(st.integers(-32_767, 32_767))
def test_an_encoded_position_is_decoded(value):
    assert SIGNED.decode(SIGNED.encode(value)) == value


@pytest.mark.parametrize(
    ("value", "register"),
    [
        (32_768, SIGNED),
        (-32_768, SIGNED),
        (-1, REGISTERS["torque_limit"]),
        (256, REGISTERS["torque"]),
    ],
)
def test_a_value_beyond_its_register_is_rejected(value, register):
    with pytest.raises(BusError, match="cannot hold"):
        register.encode(value)


def test_too_many_servos_for_a_packet_are_rejected():
    with pytest.raises(BusError, match="fewer servos"):
        packets.sync_write(dict.fromkeys(range(100), 0), SIGNED)


@given(st.binary(max_size=40))
def test_random_bytes_before_an_answer_do_not_hide_it(noise):
    # noise may begin an answer of its own that ends within the real one
    reader = packets.reader({1}, 2)
    answers = [*reader.feed(noise + ANSWER + ANSWER), *reader.flush()]
    assert any(answer.data == b"\x18\x05" for answer in answers)


def test_an_incomplete_answer_waits_for_its_rest():
    reader = packets.reader({1}, 2)
    assert list(reader.feed(ANSWER[:5])) == []
    assert [answer.id for answer in reader.feed(ANSWER[5:])] == [1]
