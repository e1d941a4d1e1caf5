"""A bus over three servos whose measurements a test sets."""

import pytest
from servos_in_memory import Clock, ServosInMemory, serve

from s2c2a.lab.emulation.servo import MotorState
from s2c2a.lab.emulation.sts3215 import STS3215
from s2c2a.lab.hardware.feetech import FeetechBus


class ScriptedServo(STS3215):
    """A servo that measures what a test has set, and is switched on by a goal."""

    takes_full_angle = True
    changes_rate_at_once = True
    port: ServosInMemory

    @property
    def baud_rate(self) -> int:
        return super().baud_rate if self.changes_rate_at_once else self.baud_rates[0]

    def is_present(self, now: float) -> bool:
        return super().is_present(now) and self.baud_rate == self.port.baudrate

    def set(self, address: int, *values: int) -> None:
        self.memory[address : address + len(values)] = bytes(values)

    def write(self, address: int, data: bytes) -> None:
        super().write(address, data)
        if address <= 42 < address + len(data):
            self["torque_enable"] = 1
        if not self.takes_full_angle:
            self["phase"] &= ~16

    def _measure(self) -> None:
        pass


@pytest.fixture
def port(monkeypatch):
    port = ServosInMemory(Clock(), "feetech")
    port.servos = [ScriptedServo(id, MotorState()) for id in (1, 2, 3)]
    for servo in port.servos:
        servo.port = port
    serve(port, monkeypatch)
    return port


@pytest.fixture
def bus(port):
    with FeetechBus("fake", 1_000_000) as opened:
        opened.accept_stored = lambda changes: True
        yield opened
