"""A bus over three scripted servos."""

import pytest
from fake_feetech_line import FakePort, serve

from s2c2a.lab.hardware.feetech import FeetechBus


@pytest.fixture
def port(monkeypatch):
    fake = FakePort(1, 2, 3)
    serve(fake, monkeypatch)
    monkeypatch.setattr("s2c2a.lab.hardware.feetech.bus.PATIENT_TIMEOUT", 0.01)
    monkeypatch.setattr("s2c2a.lab.hardware.feetech.bus.LISTEN_TIMEOUT", 0.01)
    return fake


@pytest.fixture
def bus(port):
    with FeetechBus("fake", 1_000_000) as opened:
        opened.accept_stored = lambda changes: True
        yield opened
