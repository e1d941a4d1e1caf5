"""Protocols of emulated servos: decoder, answers, models and supply of each."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from s2c2a.arm.servos import Servos
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation import dynamixel_protocol, feetech_protocol
from s2c2a.lab.emulation.answers import Answer
from s2c2a.lab.emulation.servo import MotorState, Servo
from s2c2a.lab.emulation.sts3215 import BAUD_RATES as STS_BAUD_RATES
from s2c2a.lab.emulation.sts3215 import STS3215
from s2c2a.lab.emulation.xl330 import BAUD_RATES as XL_BAUD_RATES
from s2c2a.lab.emulation.xl330 import XL330


@dataclass(frozen=True)
class Protocol:
    """One protocol with its servo.

    Attributes:
        decoder: makes an object whose `feed` returns packets.
        answer: of servos to a packet.
        make_servo: from id, state of the motor and firmware.
        baud_rates: that the servo knows [bit/s].
        supply: voltage [V].
        stuffs: whether packets are byte-stuffed.
    """

    decoder: Callable[[], Any]
    answer: Callable[[Any, list[Servo], float], list[Answer]]
    make_servo: Callable[[int, MotorState, int], Servo]
    baud_rates: tuple[int, ...]
    supply: float
    stuffs: bool


def _make_sts3215(id: int, state: MotorState, firmware: int) -> Servo:
    return STS3215(id, state)


PROTOCOLS = {
    "dynamixel": Protocol(
        dynamixel_protocol.Decoder,
        dynamixel_protocol.answer,
        XL330,
        XL_BAUD_RATES,
        supply=5.0,
        stuffs=True,
    ),
    "feetech": Protocol(
        feetech_protocol.Decoder,
        feetech_protocol.answer,
        _make_sts3215,
        STS_BAUD_RATES,
        supply=7.4,
        stuffs=False,
    ),
}


def protocol_of(table: Servos) -> Protocol:
    """Return the protocol of an arm's servos.

    Raises:
        S2C2AError: the servos do not know the baud rate.
    """
    protocol = PROTOCOLS[table.protocol]
    if table.baud_rate not in protocol.baud_rates:
        raise S2C2AError(
            f"servos.baud_rate {table.baud_rate} is not a speed of {table.protocol} "
            f"servos; choose one of {', '.join(map(str, protocol.baud_rates))}"
        )
    return protocol
