"""Topics of ROS 2 between two processes; the other one uses an SDK of another author."""

import json
import queue
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.integrations.ros.bridge import RosOptions, bridged, open_node
from s2c2a.live.control import ArmControl
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Stage
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.strategies.pcc import PlainPCC
from waiting import until

pytest.importorskip("zenoh")
PATIENCE = 300.0  # s
ROOT = Path(__file__).parents[2]


def free_port():
    with socket.socket() as chosen:
        chosen.bind(("127.0.0.1", 0))
        return chosen.getsockname()[1]


class RosSide:
    """The other process, and what it received."""

    def __init__(self, port):
        script = Path(__file__).with_name("ros_side.py")
        self._process = subprocess.Popen(
            [sys.executable, script, str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._lines = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.until("ready")

    def order(self, **words):
        self._process.stdin.write(json.dumps(words) + "\n")
        self._process.stdin.flush()

    def until(self, topic, condition=lambda message: True):
        """The next message of a topic that fulfills a condition."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            message = self._lines.get(timeout=PATIENCE)
            if message["topic"] == topic and condition(message):
                return message
        raise AssertionError(f"no such message on {topic}")

    def end(self):
        self._process.kill()
        self._process.wait()

    def _read(self):
        for line in self._process.stdout:
            if line.startswith("{"):
                self._lines.put(json.loads(line))


@pytest.fixture(scope="module")
def strategy():
    arm = load_arm("twin_arm")
    return PlainPCC().build(arm, recipe_named("best"), None, RunOptions())


@pytest.fixture
def control(twin, strategy):
    running = ArmControl(SimulatedRobot(twin), {"pcc": lambda: strategy}, {}, 1.0)
    running.start()
    yield running
    running.stop()


@pytest.fixture
def log():
    return []


@pytest.fixture
def port(control, log):
    port = free_port()
    options = RosOptions(f"tcp/127.0.0.1:{port}", router=True, timeout=0.5)
    with open_node(options) as node, bridged(control, node, options, log.append):
        yield port


@pytest.fixture
def ros(port):
    pytest.importorskip("zenoh_ros2_sdk")
    side = RosSide(port)
    yield side
    side.end()


def test_the_arm_follows_stops_resumes_and_returns_without_the_ros_side(
    ros, control, log
):
    target = [0.15, 0.05, 0.55]
    ros.order(target=target, frame="base")
    arrived = ros.until(
        "tip_pose", lambda each: np.linalg.norm(np.subtract(each["tip"], target)) < 0.05
    )
    assert arrived["frame"] == "base"
    assert abs(arrived["now"] - arrived["stamp"]) < 1.0
    joints = ros.until("joint_states")
    assert joints["names"][:2] == ["module_1_cable_1", "module_1_cable_2"]
    np.testing.assert_allclose(
        joints["values"], ros.until("joint_commands")["values"], atol=0.02
    )
    ros.order(stop=True)
    until(lambda: control.latest.stage is Stage.HOLD)
    assert control.halted_by == "a message on stop"
    ros.order(stop=False)
    ros.order(target=target, frame="base")
    until(lambda: control.latest.stage is Stage.RUN)
    ros.end()
    until(lambda: control.latest.stage is Stage.HOLD)
    assert "no target or task for 0.5 s; the arm holds" in log
    until(lambda: control.latest.stage is Stage.IDLE)


def test_the_client_of_the_page_moves_the_arm_without_an_sdk(port):
    script = ROOT / "examples" / "extending" / "ros_client.py"
    command = [sys.executable, script, f"tcp/127.0.0.1:{port}"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    tips = [[float(word) for word in line.split()[1:]] for line in printed.splitlines()]
    assert np.linalg.norm(np.subtract(tips[-1], [0.15, 0.05, 0.55])) < 0.05


def test_a_target_in_another_frame_does_not_move_the_arm(ros, control, log):
    ros.order(target=[0.15, 0.05, 0.55], frame="camera")
    until(lambda: log)
    assert log[0].startswith("refused a message on target/point: its frame is 'camera'")
    assert not control.request.driven


def test_a_taken_port_and_a_missing_router_are_named(port):
    endpoint = f"tcp/127.0.0.1:{port}"
    taken = RosOptions(endpoint, router=True)
    with pytest.raises(S2C2AError, match="is the port taken"), open_node(taken):
        pass
    missing = RosOptions(f"tcp/127.0.0.1:{free_port()}")
    refusal = r"no Zenoh router answers at .*; start one"
    with pytest.raises(S2C2AError, match=refusal), open_node(missing):
        pass


def test_an_emergency_stop_lasts(ros, control, log):
    ros.order(target=[0.15, 0.05, 0.55], frame="base")
    until(lambda: control.latest.stage is Stage.RUN)
    ros.order(emergency=True)
    until(lambda: control.latest.stage is Stage.FAULT)
    assert "emergency stop by a message of ROS" in control.latest.fault
    ros.order(stop=False)
    until(lambda: "resumed by ROS" in log)
    time.sleep(0.3)  # three control steps
    assert control.latest.stage is Stage.FAULT
