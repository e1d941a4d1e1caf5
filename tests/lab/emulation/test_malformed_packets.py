"""Servos survive whatever arrives on the line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.emulation import dynamixel_protocol, feetech_protocol
from s2c2a.lab.emulation.dynamixel_protocol import DynamixelProtocol
from s2c2a.lab.emulation.feetech_protocol import FeetechProtocol
from s2c2a.lab.emulation.instructions import PING
from s2c2a.lab.emulation.servo import MotorState

INSTRUCTIONS = st.sampled_from(
    [1, 2, 3, 4, 5, 6, 8, 0x10, 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A, 0x55, 0x77]
)
IDS = st.sampled_from([1, 2, 3, 0xFE])
each_protocol = pytest.mark.parametrize(
    ("protocol", "kind"),
    [(dynamixel_protocol, DynamixelProtocol), (feetech_protocol, FeetechProtocol)],
)


@each_protocol
@given(id=IDS, instruction=INSTRUCTIONS, parameters=st.binary(max_size=40))
def test_any_parameters_are_answered_or_ignored(
    protocol, kind, id, instruction, parameters
):
    servos = [kind.make_servo(number, MotorState()) for number in (1, 2)]
    data = protocol.pack(id, instruction, parameters)
    packets = kind.decoder().feed(data, 0.0)
    answers = [one for packet in packets for one in kind().answer(packet, servos, 0.0)]
    assert len(packets) == 1
    assert all(one.id in (1, 2) or instruction == 3 for one in answers)


@each_protocol
@given(noise=st.binary(max_size=60))
def test_noise_does_not_stop_the_decoder(protocol, kind, noise):
    decoder = kind.decoder()
    decoder.feed(noise, 0.0)
    ping = protocol.pack(1, PING)
    packets = decoder.feed(ping, 1.0)
    assert [packet.instruction for packet in packets] == [PING]
