"""What tests of several folders of hardware share."""

import pytest
from emulator_in_memory import EmulatorInMemory

from s2c2a.lab.hardware import bring_up  # noqa: F401 - before its clock is replaced


@pytest.fixture
def emulator(monkeypatch):
    """Emulated servos at the other end of a wire in memory."""
    return EmulatorInMemory(monkeypatch)
