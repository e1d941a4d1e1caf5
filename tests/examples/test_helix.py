"""The Helix of the examples, with a small imitation of its bridge."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.errors import RobotError
from s2c2a.robots.factory import robot_class
from waiting import until

from helix_bridge import HelixBridge  # type: ignore[import-not-found]

FOLDER = Path(__file__).parents[2] / "examples" / "extending"
ROBOT = f"{FOLDER / 'helix_robot.py'}:Helix"
ARM = FOLDER / "helix.toml"
BEND = np.array([[-0.01, 0.005, 0.005], [0.0, 0.002, -0.002], [0.0, 0.0, 0.0]])


wait = partial(until, seconds=5.0)


@pytest.fixture
def bridge():
    bridge = HelixBridge()
    yield bridge
    bridge.close()


def helix(bridge, **options):
    return robot_class(ROBOT)(
        load_arm(ARM), host="127.0.0.1", port=bridge.port, **options
    )


@pytest.mark.parametrize("interface", ["sdk", "transmission"])
def test_the_helix_fulfills_the_interface_contract(interface, capsys):
    bridge = HelixBridge(interface)
    options = ["host=127.0.0.1", f"port={bridge.port}", f"interface={interface}"]
    arm = ["--arm", str(ARM)]
    main(["robot", "check", "--robot", ROBOT, *arm, "--robot-option", *options])
    bridge.close()
    output = capsys.readouterr().out
    assert "ok: the arm moves as commanded" in output
    assert "fulfills the interface contract" in output


def test_commands_are_lengths_of_tendons_within_their_segment(bridge):
    with helix(bridge) as robot:
        sent = robot.send(BEND)
        wait(lambda: np.allclose(robot.read()["cables"], BEND, atol=1e-4))
        np.testing.assert_allclose(bridge.desired - bridge.zero, np.ravel(sent))
    assert bridge.advertised == {
        "/helix/command/tendon_lengths": "control_msgs/InterfaceValue"
    }


def test_a_bent_arm_goes_slowly_to_rest_when_it_is_opened():
    bridge = HelixBridge("transmission", bent=0.01)
    with helix(bridge, interface="transmission") as robot:
        np.testing.assert_allclose(robot.read()["cables"], 0.0, atol=1e-4)
        assert bridge.commands >= 25  # 1 cm at 2 cm/s
    bridge.close()


def test_a_helix_that_does_not_run_is_not_commanded(bridge, monkeypatch):
    bridge.state = "INITIALIZED"
    robot = helix(bridge)
    monkeypatch.setitem(robot.open.__func__.__globals__, "PATIENCE", 0.3)
    with pytest.raises(RobotError, match=r"INITIALIZED.*press its button"):
        robot.open()
    robot.close()
    assert bridge.commands == 0


def test_lengths_that_do_not_come_are_a_fault_of_the_reading(bridge):
    with helix(bridge) as robot:
        bridge.silent = True
        wait(lambda: "no tendon lengths" in robot.read().fault)
        assert np.isnan(robot.read()["cables"]).all()
        bridge.silent = False
        wait(lambda: not robot.read().fault)


def test_an_emergency_stop_holds_the_lengths_that_are_measured(bridge):
    with helix(bridge) as robot:
        robot.send(BEND)
        robot.halt()
        wait(lambda: np.abs(bridge.desired - bridge.zero).max() < 0.01)


def test_an_address_without_a_helix_is_reported(bridge):
    robot = helix(bridge)
    bridge.close()
    with pytest.raises(RobotError, match="check host and network"):
        robot.open()
    robot.close()


def test_another_arm_or_interface_is_refused():
    make = robot_class(ROBOT)
    with pytest.raises(RobotError, match=r"helix\.toml"):
        make(load_arm("planar_finger"), host="x")
    with pytest.raises(RobotError, match="sdk, transmission"):
        make(load_arm(ARM), host="x", interface="ros")


@pytest.mark.parametrize(
    "content",
    [
        {"name": ["tendon0"], "position": [0.1]},
        {"name": [f"joint{n}" for n in range(9)], "position": [0.1] * 8 + [np.nan]},
        {"name": ["tendon0"] * 9, "position": [0.1] * 9},
        {"name": [f"tendon{n}" for n in range(2, 11)], "position": [0.1] * 9},
    ],
)
def test_damaged_lengths_are_no_reading(content, bridge):
    robot = helix(bridge)
    text = json.dumps({"topic": "/helix/estimated/tendon_lengths", "msg": content})
    robot._hear(text)
    assert robot.read().fault
