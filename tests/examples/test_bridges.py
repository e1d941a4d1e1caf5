"""Bridges to JSON datagrams, each with a small stand-in of its library."""

import math
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from s2c2a.lab.tracking import UdpTracker
from waiting import until

FOLDER = Path(__file__).parents[2] / "examples" / "extending"
POSITION = [0.01, 0.0, 0.2]
ROTATION = [0.0, 0.0, 0.0, 1.0]


class OverError(Exception):
    """The stand-in has no more poses."""


def module(name, **names):
    made = ModuleType(name)
    vars(made).update(names)
    return made


class Tracker:
    """A tracker of VRPN with two poses."""

    def __init__(self, name):
        self.name = name
        self.left = 2

    def register_change_handler(self, user, handler, kind):
        assert kind == "position"
        self.handler = handler
        self.user = user

    def mainloop(self):
        if not self.left:
            raise OverError
        self.left -= 1
        self.handler(self.user, {"position": POSITION, "quaternion": ROTATION})


def vrpn():
    receiver = SimpleNamespace(Tracker=Tracker)
    return {"vrpn": module("vrpn", receiver=receiver)}


def ros2():
    callbacks = []

    def spin(node):
        place = SimpleNamespace(**dict(zip("xyz", POSITION, strict=True)))
        turn = SimpleNamespace(**dict(zip("xyzw", ROTATION, strict=True)))
        for second in (1, 2):
            stamp = SimpleNamespace(sec=second, nanosec=500)
            message = SimpleNamespace(
                pose=SimpleNamespace(position=place, orientation=turn),
                header=SimpleNamespace(stamp=stamp),
            )
            for callback in callbacks:
                callback(message)
        raise OverError

    def subscribe(kind, topic, callback, depth):
        callbacks.append(callback)

    node = SimpleNamespace(create_subscription=subscribe)
    rclpy = module("rclpy", init=lambda: None, create_node=lambda _: node, spin=spin)
    messages = module("geometry_msgs.msg", PoseStamped=object)
    package = module("geometry_msgs")
    return {"rclpy": rclpy, package.__name__: package, messages.__name__: messages}


def lsl():
    samples = [([*POSITION, *ROTATION] * 2, time) for time in (1.0, 1.1)]

    def pull_sample():
        if not samples:
            raise OverError
        return samples.pop(0)

    return {
        "pylsl": module(
            "pylsl",
            resolve_byprop=lambda *_, **__: ["info"],
            StreamInlet=lambda _: SimpleNamespace(pull_sample=pull_sample),
        )
    }


BRIDGES = {
    "bridge_vrpn.py": (vrpn, ["host", "PORT", "base", "end-1"]),
    "bridge_ros2.py": (ros2, ["PORT", "base=/base", "end-1=/end"]),
    "bridge_lsl.py": (lsl, ["mocap", "PORT", "base", "end-1"]),
}


def run(name, port, monkeypatch):
    words = [str(port) if word == "PORT" else word for word in BRIDGES[name][1]]
    monkeypatch.setattr(sys, "argv", [name, *words])
    runpy.run_path(str(FOLDER / name), run_name="__main__")


@pytest.mark.parametrize("name", BRIDGES)
def test_the_tracker_accepts_what_a_bridge_sends(name, monkeypatch):
    for key, stand_in in BRIDGES[name][0]().items():
        monkeypatch.setitem(sys.modules, key, stand_in)
    with UdpTracker(port=0) as tracker:
        with pytest.raises(OverError):
            run(name, tracker.address[1], monkeypatch)
        until(lambda: tracker.counts.accepted >= 2, seconds=10.0)
        frame = tracker.latest()
    assert frame.number == 1
    assert set(frame.poses) == {"base", "end-1"}
    assert math.isclose(frame.poses["end-1"].position[2], 0.2)


@pytest.mark.parametrize("name", BRIDGES)
def test_a_missing_library_is_named(name, monkeypatch):
    for key in BRIDGES[name][0]():
        monkeypatch.setitem(sys.modules, key, None)
    with pytest.raises(SystemExit, match="is missing"):
        run(name, 9763, monkeypatch)
