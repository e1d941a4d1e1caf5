"""ROS 2 as the driver of an arm: presence, bounded rates, stops, refusals."""

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from s2c2a.integrations.ros.driver import MAX_RATE, RosDriver
from s2c2a.integrations.ros.inputs import Inputs
from s2c2a.integrations.ros.messages import (
    MARKERS,
    POINT,
    SWITCH,
    TEXT,
    encode,
    header_of,
    new,
)
from s2c2a.integrations.ros.outputs import Outputs
from s2c2a.integrations.ros.reporter import Reporter
from s2c2a.live.request import RequestLimits
from s2c2a.live.snapshot import Control
from s2c2a.runtime.emergency import EMERGENCY_STOP
from waiting import until

pytest.importorskip("rosbags")


class RecordingControl(Control):
    """A control without an arm, which records what it is asked for."""

    responds = True

    def __init__(self, arm):
        super().__init__()
        self.arm = arm
        self.limits = RequestLimits.of(arm, ("circle",))
        self.asked = []

    def ask(self, **changes):
        self.asked.append(changes)
        return super().ask(**changes)

    def order(self, name, *arguments):
        raise NotImplementedError

    def use(self, name):
        raise NotImplementedError

    def stop(self):
        raise NotImplementedError


@pytest.fixture
def control(twin):
    return RecordingControl(twin)


@pytest.fixture
def log():
    return []


@pytest.fixture
def driver(control, log):
    inputs = Inputs(control.limits, "base", time.time)
    running = RosDriver(control, inputs, 0.2, log.append)
    yield running
    running.close()


def target(x, frame="base"):
    place = new("geometry_msgs/msg/Point", x=x, y=0.0, z=0.5)
    return encode(POINT, new(POINT, header=header_of(frame, 0.0), point=place))


def switch(on):
    return encode(SWITCH, new(SWITCH, data=on))


def test_a_target_drives_until_it_is_silent(driver, control, log):
    driver.put("target/point", target(0.1))
    until(lambda: control.request.driven)
    assert control.request.target == (0.1, 0.0, 0.5)
    until(lambda: not control.request.driven)
    assert log == ["no target or task for 0.2 s; the arm holds"]


def test_obstacles_alone_drive_nothing(driver, control):
    driver.put("obstacles", encode(MARKERS, new(MARKERS, markers=[])))
    until(lambda: control.asked)
    assert not control.request.driven


def test_a_flood_becomes_few_requests_and_the_last_target_counts(driver, control):
    begun = time.monotonic()
    for number in range(3000):
        driver.put("target/point", target(number * 1e-4))
    until(lambda: control.request.target == (pytest.approx(0.2999), 0.0, 0.5))
    assert len(control.asked) <= 2 + MAX_RATE * (time.monotonic() - begun)


def test_refused_messages_are_counted_and_logged_once_a_second(driver, control, log):
    for number in range(5):
        driver.put("target/point", target(np.nan))
        until(lambda expected=number + 1: driver.refused == expected)
    assert len(log) == 1
    assert "not all finite" in log[0]
    assert control.asked == []


def test_a_stop_is_obeyed_in_the_calling_thread_and_lasts(driver, control, log):
    driver.switch("stop", switch(True))
    assert control.request.stopped
    driver.put("target/point", target(0.1))
    until(lambda: control.request.driven)
    assert control.request.stopped
    driver.switch("stop", switch(False))
    assert not control.request.stopped
    assert log == ["stop by ROS", "resumed by ROS"]


def test_a_stop_that_cannot_be_read_stops(driver, control, log):
    driver.switch("stop", b"?")
    assert control.request.stopped
    assert driver.refused == 1


def test_an_emergency_stop_triggers_that_of_the_package(driver, control):
    driver.switch("emergency_stop", switch(False))
    assert not EMERGENCY_STOP.is_triggered
    driver.switch("emergency_stop", switch(True))
    assert EMERGENCY_STOP.is_triggered
    assert control.request.stopped


def test_an_ended_task_leaves_the_arm_where_it_is(driver, control, snapshot, twin):
    control._show(snapshot)
    driver.put("task", encode(TEXT, new(TEXT, data="circle")))
    until(lambda: control.request.task == "circle")
    assert control.request.playing
    driver.put("task", encode(TEXT, new(TEXT, data="")))
    until(lambda: control.request.task is None)
    assert control.request.target == pytest.approx((0.0, 0.0, twin.length))


def test_without_a_driver_left_nobody_drives(control):
    inputs = Inputs(control.limits, "base", time.time)
    driver = RosDriver(control, inputs, 60.0, lambda _: None)
    driver.put("target/point", target(0.1))
    until(lambda: control.request.driven)
    driver.close()
    assert not control.request.driven


class RecordingNode:
    """Keeps what is published, by topic."""

    def __init__(self):
        self.published = {}

    def publisher(self, topic):
        messages = self.published.setdefault(topic.name, [])
        return messages.append


@pytest.fixture
def node():
    return RecordingNode()


@pytest.fixture
def reporter(control, twin, node, log):
    outputs = Outputs(twin, "base")
    return Reporter(control, outputs, node, "/arm", lambda: 3, log.append)


def test_every_step_is_published_and_markers_and_status_seldom(
    control, snapshot, node, reporter
):
    poses = node.published["/arm/tip_pose"]
    for number in range(5):
        control._show(snapshot)
        until(lambda expected=number + 1: len(poses) == expected)
    reporter.close()
    counts = {name: len(messages) for name, messages in node.published.items()}
    assert counts["/arm/joint_states"] == counts["/arm/joint_commands"] == 5
    assert counts["/arm/markers"] == 1
    assert 1 <= counts["/diagnostics"] <= 2
    values = node.published["/diagnostics"][-1].status[0].values
    assert ("refused_messages", "3") in [(pair.key, pair.value) for pair in values]


def test_the_page_describes_every_key_of_the_status(control, snapshot, node, reporter):
    control._show(snapshot)
    reporter.close()
    page = Path(__file__).parents[2] / "docs" / "guides" / "ros.md"
    table = page.read_text(encoding="utf-8").partition("| key | value |")[2]
    rows = table.partition("\n\n")[0].splitlines()
    keys = [
        key for row in rows[2:] for key in re.findall(r"`(\w+)`", row.split("|")[1])
    ]
    values = node.published["/diagnostics"][-1].status[0].values
    assert keys == [pair.key for pair in values]


def test_an_odd_sensor_does_not_end_the_topics(control, snapshot, node, reporter, log):
    odd = replace(snapshot.step.reading, sensors={"cables": np.zeros(4)})
    step = replace(snapshot.step, reading=odd)
    control._show(replace(snapshot, step=step))
    until(lambda: log)
    control._show(snapshot)
    until(lambda: node.published["/arm/tip_pose"])
    reporter.close()
    assert len(log) == 1
