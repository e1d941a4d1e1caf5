"""The part of the plug-in for LeRobot that does not know LeRobot."""

import importlib.util
import sys
import time
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from s2c2a import run
from s2c2a.arm import load_arm
from s2c2a.cli.export_table import table_of
from s2c2a.errors import ActionError, RobotError, S2C2AError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime.limits import CommandLimits
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import load_task

PLUGIN = Path(__file__).parents[2] / "plugins/lerobot_robot_s2c2a"
ARM = load_arm("twin_arm")
PERIOD = ARM.control_period


def load(name: str):
    """A module of the plug-in, whose package imports LeRobot."""
    full = f"lerobot_robot_s2c2a.{name}"
    file = PLUGIN / "src/lerobot_robot_s2c2a" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(full, file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[full] = module
    spec.loader.exec_module(module)
    return module


arm = load("arm")
expert = load("expert")


def clock(rate: float):
    """A clock of frames at a rate [Hz]."""
    return count(0.0, 1.0 / rate).__next__


@pytest.fixture
def driven():
    """An open simulated arm, with frames at its control rate."""
    made = arm.DrivenArm(SimulatedRobot(ARM), now=clock(ARM.control_rate))
    made.open()
    yield made
    made.close()


def commands(value: float) -> dict[str, float]:
    return {f"cable.{m + 1}.{c + 1}": value for m, c in np.ndindex(3, 3)}


def test_an_arm_returns_the_limited_commands_that_it_sent(driven):
    sent = driven.step(commands(1.0) | {"cable.1.1": -1.0})
    limits = CommandLimits.of(ARM)
    change = np.reshape(list(sent.values()), (3, 3)) - limits.rest
    sizes = limits.change_sizes(change)
    assert 0.0 < sizes.max() <= limits.acceleration_limit.max() + 1e-9


def test_a_frame_advances_a_simulated_arm_by_one_control_period(driven):
    times = []
    for _ in range(3):
        driven.observe()
        times.append(driven.reading.time)
        driven.step(commands(0.0))
    np.testing.assert_allclose(np.diff(times), PERIOD)


@pytest.mark.slow
def test_numbers_of_observations_are_named_as_in_exports(driven):
    task = load_task("reach-0", ARM)
    episode = run(SimulatedRobot(ARM), pcc_strategy(ARM), task)
    columns = {name.removeprefix("sensor.") for name in table_of([episode])}
    assert driven.sensor_names
    assert set(driven.sensor_names) <= columns
    assert tuple(driven.observe()) == driven.sensor_names


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ({"cable.1.1": 0.0}, r"this arm takes cable\.1\.1, cable\.1\.2"),
        (commands(float("nan")), "not finite"),
        (commands("much"), "no number"),
    ],
)
def test_bad_actions_are_refused_before_anything_is_sent(driven, action, message):
    with pytest.raises(ActionError, match=message):
        driven.step(action)
    driven.observe()
    assert driven.reading.time == 0.0


def test_frames_faster_than_the_control_rate_are_an_error():
    fast = arm.DrivenArm(SimulatedRobot(ARM), now=clock(30.0))
    fast.open()
    for _ in range(arm.CHECKED_FRAMES):
        fast.step(commands(0.0))
    with pytest.raises(RobotError, match=r"30\.0 frames.*--dataset\.fps=10"):
        fast.step(commands(0.0))
    fast.close()


def test_frames_slower_than_the_control_rate_are_a_warning(caplog):
    slow = arm.DrivenArm(SimulatedRobot(ARM), now=clock(5.0))
    slow.open()
    for _ in range(arm.CHECKED_FRAMES + 1):
        slow.step(commands(0.0))
    slow.close()
    assert "5.0 frames a second" in caplog.text


def test_the_arm_sends_the_commands_of_an_expert_as_they_are(driven):
    shown = expert.Expert(driven, "circle")
    for _ in range(12):
        driven.observe()
        action = shown.action()
        assert driven.step(action) == pytest.approx(action, abs=1e-12)
    assert max(action.values()) > 0.001


def test_an_arm_follows_targets_of_the_tip():
    made = arm.open_arm("twin_arm", action_space="tip")
    made.open()
    before = made.reading["states"][-1, :3].copy()
    shown = expert.Expert(made, "circle")
    for _ in range(12):
        made.observe()
        action = shown.action()
        assert made.step(action) == pytest.approx(action)
    made.close()
    assert tuple(action) == ("tip.x", "tip.y", "tip.z")
    target = np.array(list(action.values()))
    after = made.reading["states"][-1, :3]
    assert np.linalg.norm(after - target) < 0.7 * np.linalg.norm(before - target)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"action_space": "joints"}, "give cables or tip"),
        ({"sensors": ("camera",)}, "no sensor camera; it has .*cables"),
        ({"weights": "shipped"}, "action_space=tip"),
    ],
)
def test_choices_that_do_not_exist_are_named(options, message):
    with pytest.raises(S2C2AError, match=message):
        arm.open_arm("twin_arm", **options)


def test_an_arm_that_is_stopped_ends_the_recording(driven, monkeypatch):
    driven.step(commands(0.0))
    monkeypatch.setattr(driven._loop, "standstill", "the program stood still for 11 s")
    driven._loop.fault = driven._loop.standstill
    with pytest.raises(RobotError, match="stood still for 11 s"):
        driven.step(commands(0.0))


class RealArm(SimulatedRobot):
    """An arm in real time, which stops without commands, as servos do."""

    own_time = False
    openings = 0

    def open(self):
        self.openings += 1
        return super().open()


def test_a_real_arm_begins_anew_after_networks_were_loaded():
    robot = RealArm(ARM)
    made = arm.DrivenArm(robot)
    made.open()
    made.observe()
    made.observe()
    made.close()
    assert robot.openings == 2


def test_an_expert_holds_while_a_reading_has_a_fault(driven):
    shown = expert.Expert(driven, "circle")
    driven.observe()
    rest = shown.action()
    driven.reading = replace(driven.reading, sensors={}, fault="servo 3 is silent")
    assert shown.action() == rest


def frames(rate: float) -> None:
    """Frames of a real arm at the pace of LeRobot's loops, until the check."""
    made = arm.DrivenArm(RealArm(ARM))
    made.open()
    try:
        made.observe()
        time.sleep(0.6 * PERIOD)  # begins between two steps of the control loop
        for _ in range(arm.CHECKED_FRAMES + 1):
            began = time.perf_counter()
            made.step(commands(0.0))
            spent = time.perf_counter() - began
            time.sleep(max(1.0 / rate - spent, 0.0))
    finally:
        made.close()


def test_a_real_arm_leaves_the_pace_to_frames_at_its_control_rate():
    frames(ARM.control_rate)


def test_a_real_arm_waits_where_frames_are_too_fast_and_then_says_so():
    began = time.perf_counter()
    with pytest.raises(RobotError, match=r"--dataset\.fps=10"):
        frames(30.0)
    least = arm.SHORTEST * PERIOD * (arm.CHECKED_FRAMES - 1)
    assert time.perf_counter() - began > least
