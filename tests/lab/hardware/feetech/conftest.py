"""A bus over three scripted servos."""

import pytest
from fake_feetech_line import FakePort, serve

from s2c2a.lab.hardware.feetech import FeetechBus


@pytest.fixture
def port(monkeypatch):
    fake = FakePort(1, 2, 3)
    serve(fake, monkeypatch)
    for name in ("EXCHANGE_MARGIN", "LISTEN_MARGIN", "QUIET_TIME"):
        monkeypatch.setattr(f"s2c2a.lab.hardware.serial_bus.{name}", 0.01)
    return fake


@pytest.fixture
def bus(port):
    with FeetechBus("fake", 1_000_000) as opened:
        opened.accept_stored = lambda changes: True
        yield opened
