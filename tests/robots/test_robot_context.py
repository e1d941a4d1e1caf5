"""A robot as a context manager: entering opens it, leaving always closes it."""

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.robots import Robot


class _Noted(Robot):
    """A robot that notes what it is told."""

    def __init__(self, fault: Exception | None = None):
        self.notes: list[str] = []
        self.fault = fault

    @property
    def sensors(self):
        return {}

    def open(self):
        self.notes.append("open")
        if self.fault is not None:
            raise self.fault

    def read(self):
        self.notes.append("read")

    def send(self, action):
        self.notes.append("send")

    def close(self):
        self.notes.append("close")


def test_entering_opens_and_leaving_closes():
    robot = _Noted()
    with robot as entered:
        entered.read()
    assert entered is robot
    assert robot.notes == ["open", "read", "close"]


def test_an_error_inside_closes_the_robot_and_propagates():
    robot = _Noted()
    with pytest.raises(S2C2AError, match="inside"), robot:
        raise S2C2AError("inside")
    assert robot.notes == ["open", "close"]


def test_a_robot_that_fails_while_opening_is_closed_too():
    """Its motors may hold already when the opening fails."""
    robot = _Noted(fault=S2C2AError("no way to rest"))
    with pytest.raises(S2C2AError, match="no way to rest"), robot:
        pass
    assert robot.notes == ["open", "close"]


def test_an_incomplete_robot_cannot_be_created():
    class Half(Robot):
        def open(self):
            """Nothing."""

    with pytest.raises(TypeError, match=r"close.*read.*send.*sensors"):
        Half()
