"""Teleoperation: devices, a simulated arm that follows them, and demonstrations."""

import os
import time
from functools import partial

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.export import export
from s2c2a.data import load_recording
from s2c2a.emergency import EMERGENCY_STOP
from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.errors import S2C2AError
from s2c2a.integrations.cli import teleoperate
from s2c2a.integrations.teleoperation.demonstrations import Demonstrations
from s2c2a.integrations.teleoperation.device import (
    Button,
    DeviceInput,
    read_input,
)
from s2c2a.integrations.teleoperation.devices import device_named
from s2c2a.integrations.teleoperation.gamepad import Gamepad, PadState
from s2c2a.integrations.teleoperation.keyboard import HOLD, Keyboard, split_keys
from s2c2a.integrations.teleoperation.teleoperation import Teleoperation
from s2c2a.live.control import ArmControl
from s2c2a.live.steering import SPEED, largest_speed, moved_target
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Clock
from s2c2a.spaces import Stage
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.strategies.pcc import PlainPCC

FASTER = 10.0


class FastClock(Clock):
    """Ten seconds a second."""

    def now(self):
        return FASTER * time.perf_counter()

    def wait_until(self, moment):
        time.sleep(max(moment - self.now(), 0.0) / FASTER)


class Script:
    """A device that gives what a test says."""

    help = "none"

    def __init__(self, speed=1.0):
        self.given = DeviceInput()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def read(self):
        given, self.given = self.given, DeviceInput(self.given.velocity)
        return given


@pytest.fixture(scope="module")
def strategy(twin):
    return PlainPCC().build(twin, recipe_named("best"), None, RunOptions())


@pytest.fixture
def control(twin, strategy):
    running = ArmControl(
        SimulatedRobot(twin), {"pcc": lambda: strategy}, {}, 0.1, FastClock()
    )
    running.start()
    yield running
    EMERGENCY_STOP.reset()
    running.stop()


class Driver:
    """Steps of a teleoperation, in the time of the fast clock."""

    def __init__(self, control, path=None):
        self.control = control
        self.device = Script()
        self.demonstrations = path and Demonstrations(path, control, {"device": "x"})
        self.teleoperation = Teleoperation(control, self.device, self.demonstrations)

    def press(self, button):
        self.device.given = DeviceInput((0.0, 0.0, 0.0), (button,))
        self.teleoperation.step(0.0)

    def move(self, velocity, seconds):
        self.device.given = DeviceInput(velocity)
        for _ in range(round(seconds / 0.1)):
            before = self.control.latest.step.number
            self.teleoperation.step(0.1)
            self.wait(lambda: self.control.latest.step.number > before)  # noqa: B023
        self.device.given = DeviceInput()

    def wait(self, condition):
        """Wait for a step of the arm, unless it stands still."""
        end = time.monotonic() + 0.3
        while not condition() and time.monotonic() < end:
            time.sleep(0.001)

    def until(self, condition, what, seconds=300.0):
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            self.teleoperation.step(0.02)
            time.sleep(0.002)
        assert condition(), f"{what} was not met: {self.teleoperation.status()}"


def is_at(control, stage):
    return lambda: control.latest.stage is stage


@pytest.mark.slow
def test_the_tip_follows_the_target_and_stays_when_keys_are_released(control):
    driver = Driver(control)
    time.sleep(0.05)
    assert control.latest.stage is Stage.IDLE  # nobody moved anything yet
    driver.move((0.1, 0.0, -0.02), 1.5)
    assert control.request.target == pytest.approx((0.15, 0.0, 0.57), abs=0.01)
    driver.until(lambda: control.latest.error < 0.02, "arriving")
    held = control.request.target
    driver.move((0.0, 0.0, 0.0), 1.0)
    assert control.request.target == held
    assert control.latest.stage is Stage.RUN
    assert "error" in driver.teleoperation.status()


def test_the_target_is_no_faster_and_no_farther_than_documented(twin):
    limit = largest_speed(twin)
    assert limit == pytest.approx(0.25 * 0.6)
    start = (0.0, 0.0, 0.5)
    moved = moved_target(start, (9.0, 0.0, 0.0), 0.05, twin)
    assert moved[0] == pytest.approx(0.05 * limit)
    late = moved_target(start, (9.0, 0.0, 0.0), 60.0, twin)
    assert late[0] == pytest.approx(0.1 * limit)  # no jump after a standstill
    for _ in range(200):
        start = moved_target(start, (0.0, 0.0, 1.0), 0.1, twin)
    assert start == pytest.approx((0.0, 0.0, twin.length))
    assert moved_target(start, (np.nan, 0.0, 0.0), 0.1, twin) == start
    assert SPEED == 0.25


def test_rest_returns_the_arm_and_the_next_motion_starts_at_the_tip(control):
    driver = Driver(control)
    driver.move((0.1, 0.0, 0.0), 1.0)
    driver.press(Button.REST)
    driver.until(is_at(control, Stage.IDLE), "rest")
    driver.until(lambda: abs(control.latest.tip[0]) < 0.01, "the straight arm")
    driver.move((0.0, 0.1, 0.0), 0.1)
    assert control.request.target[:2] == pytest.approx((0.0, 0.01), abs=0.011)
    driver.until(is_at(control, Stage.RUN), "running again")


def test_an_emergency_stop_ends_the_motion_until_it_is_resumed(control):
    driver = Driver(control)
    driver.move((0.1, 0.0, 0.0), 1.0)
    driver.press(Button.STOP)
    driver.until(is_at(control, Stage.FAULT), "the stop")
    assert "emergency stop by the operator" in driver.teleoperation.status()
    before = control.request.target
    driver.move((0.1, 0.0, 0.0), 0.2)
    assert control.request.target == before
    driver.press(Button.RESUME)
    driver.until(is_at(control, Stage.IDLE), "rest")
    driver.move((0.1, 0.0, 0.0), 0.3)
    driver.until(is_at(control, Stage.RUN), "running again")


def record(driver, velocity, seconds=6.0):
    driver.press(Button.RECORD)
    driver.move(velocity, seconds)
    driver.press(Button.RECORD)


@pytest.mark.slow
def test_every_demonstration_is_an_episode_that_other_commands_read(control, tmp_path):
    path = tmp_path / "demos.episodes"
    driver = Driver(control, path)
    driver.move((0.05, 0.0, 0.0), 0.5)
    record(driver, (0.05, 0.0, 0.0))
    assert driver.teleoperation.message == "saved demonstration 1"
    driver.press(Button.RECORD)
    driver.move((0.0, 0.05, 0.0), 1.0)
    driver.press(Button.DISCARD)
    record(driver, (0.0, 0.05, 0.0))
    driver.demonstrations.close()
    again = Driver(control, path)
    record(again, (0.0, -0.05, 0.0))
    again.demonstrations.close()
    episodes, options = load_episodes(path)
    assert options["verb"] == "teleoperate"
    assert len(episodes) == 3
    assert all(len(episode) >= 50 for episode in episodes)
    assert np.ptp(episodes[1]["desired_positions"][:, -1, 1]) > 0.2
    recording = load_recording(path)
    assert {"cables", "states"} <= set(recording.sensors)
    export(str(path), tmp_path / "demos.csv")
    assert any(tmp_path.glob("demos*.csv"))


def test_a_file_of_something_else_is_refused_at_the_door(control, tmp_path):
    path = tmp_path / "demos.episodes"
    driver = Driver(control, path)
    driver.move((0.05, 0.0, 0.0), 0.5)
    record(driver, (0.05, 0.0, 0.0), 1.0)
    driver.demonstrations.close()
    (episode,), _ = load_episodes(path)
    other = save_episodes([episode], tmp_path / "other.episodes", {"verb": "collect"})
    with pytest.raises(S2C2AError, match=r"no demonstrations.*another --out"):
        Demonstrations(other, control, {})


def test_a_file_without_a_demonstration_is_removed(control, tmp_path):
    path = tmp_path / "demos.episodes"
    driver = Driver(control, path)
    driver.press(Button.RECORD)
    driver.press(Button.RECORD)
    assert "did not move" in driver.teleoperation.message
    driver.demonstrations.close()
    assert not path.exists()


def test_without_a_file_nothing_is_recorded(control):
    driver = Driver(control)
    driver.press(Button.RECORD)
    assert driver.teleoperation.message == "nothing is recorded without --out"
    driver.press(Button.QUIT)
    assert driver.teleoperation.ended


@pytest.fixture
def terminal():
    """A pseudo-terminal: the file of the program, and that of the person."""
    pty = pytest.importorskip("pty")
    person, program = pty.openpty()
    yield program, person
    os.close(person)
    os.close(program)


def test_keys_of_a_terminal_move_the_target_while_they_are_held(terminal):
    termios = pytest.importorskip("termios")

    program, person = terminal
    moment = [0.0]
    before = termios.tcgetattr(program)
    with Keyboard(0.1, lambda: moment[0], program) as keyboard:
        assert keyboard.read() == DeviceInput()
        os.write(person, b"d\x1b[Ar")  # right, forward, up
        time.sleep(0.05)
        given = keyboard.read()
        assert given.velocity == pytest.approx(np.full(3, 0.1 / np.sqrt(3)))
        moment[0] = 0.9 * HOLD
        assert any(keyboard.read().velocity)
        moment[0] = 1.1 * HOLD
        assert keyboard.read() == DeviceInput()
        os.write(person, b"\n D")
        time.sleep(0.05)
        given = keyboard.read()
        assert given.pressed == (Button.RECORD, Button.STOP)
        assert given.velocity == (0.0, 0.0, 0.0)  # a button ends the motion
    assert termios.tcgetattr(program) == before


def test_keys_are_split_also_where_arrows_have_another_form():
    assert split_keys("\x1bOAW\x1b[Bq\x1b") == ["\x1b[A", "w", "\x1b[B", "q", "\x1b"]


def test_a_keyboard_needs_a_terminal(tmp_path):
    with (
        open(tmp_path / "file", "w") as file,
        pytest.raises(S2C2AError, match="no terminal"),
        Keyboard(0.1, file=file.fileno()),
    ):
        pass


class FakePad:
    def __init__(self):
        self.sticks = np.zeros(3)
        self.down = frozenset()
        self.is_open = True

    def poll(self):
        return PadState(self.sticks, self.down)

    def quit(self):
        self.is_open = False


def test_sticks_of_a_gamepad_move_the_target_beyond_the_dead_zone():
    pad = FakePad()
    with Gamepad(0.1, lambda: pad) as gamepad:
        pad.sticks = np.array([0.1, -0.1, 0.0])
        assert gamepad.read() == DeviceInput()
        pad.sticks = np.array([1.0, -0.575, 0.0])
        assert gamepad.read().velocity == pytest.approx((0.1, -0.05, 0.0))
        pad.down = frozenset({0, 1})
        assert gamepad.read().pressed == (Button.RECORD, Button.STOP)
        assert gamepad.read().pressed == ()  # still down
    assert not pad.is_open


def test_no_gamepad_is_reported_with_the_way_out():
    pytest.importorskip("pygame")
    with pytest.raises(S2C2AError, match="--device keyboard"), Gamepad(0.1):
        pass


def test_a_device_of_a_users_own_is_found_by_its_file(tmp_path):
    path = tmp_path / "my_device.py"
    path.write_text(
        "class Still:\n"
        "    help = 'nothing'\n"
        "    def __init__(self, speed): self.speed = speed\n"
        "    def __enter__(self): return self\n"
        "    def __exit__(self, *error): pass\n"
        "    def read(self): return None\n"
        "class Other:\n"
        "    def __init__(self, speed): pass\n"
    )
    assert device_named(f"{path}:Still", 0.1).speed == 0.1
    with pytest.raises(S2C2AError, match="no device"):
        device_named(f"{path}:Other", 0.1)
    with pytest.raises(S2C2AError, match="gamepad"):
        device_named("mouse", 0.1)


WRONG_INPUTS = [
    ({"velocity": "fast"}, "velocity is 'fast'; give three finite numbers"),
    ({"velocity": None}, "velocity is None"),
    ({"velocity": (0.1, 0.0)}, r"velocity is \(0.1, 0.0\)"),
    ({"velocity": ((0.1,), 0.0, 0.0)}, "three finite numbers"),
    ({"velocity": (0.1, np.nan, 0.0)}, "three finite numbers"),
    ({"velocity": ("0.1", 0.0, 0.0)}, "three finite numbers"),
    ({"pressed": Button.RECORD}, "give a tuple of buttons: Button.RECORD, "),
    ({"pressed": ("jump",)}, "give a tuple of buttons"),
    ({"pressed": 3}, "pressed is 3"),
]


@pytest.mark.parametrize(("values", "message"), WRONG_INPUTS)
def test_a_wrong_input_names_the_device_and_what_is_allowed(values, message):
    class Wrong(Script):
        def read(self):
            return DeviceInput(**values)

    with pytest.raises(S2C2AError, match=f"the device Wrong: ValueError: .*{message}"):
        read_input(Wrong())


@pytest.mark.parametrize("given", [None, (0.1, 0.0, 0.0)])
def test_something_else_than_an_input_names_the_device(given):
    class Other(Script):
        def read(self):
            return given

    with pytest.raises(S2C2AError, match=r"the device Other gives .*a DeviceInput"):
        read_input(Other())


def test_arrays_lists_and_names_of_buttons_are_inputs():
    given = DeviceInput(np.array([0.1, 0.0, 0.2], np.float32), ["record"])
    assert given.velocity == pytest.approx((0.1, 0.0, 0.2))
    assert given.pressed == (Button.RECORD,)


def test_a_device_that_cannot_be_made_is_named(tmp_path):
    path = tmp_path / "no_port.py"
    path.write_text("class Broken:\n    def __init__(self): pass\n")
    with pytest.raises(S2C2AError, match=r"the device .*no_port.py:Broken: TypeError"):
        device_named(f"{path}:Broken", 0.1)


def test_a_strategy_is_chosen_by_name():
    arm = load_arm("twin_arm")
    names = partial(teleoperate.strategies_named, arm, weights=())
    assert next(iter(names(strategy=""))) == "s2c2a · best"
    assert next(iter(names(strategy="pcc"))) == "pcc · best"


SHORT = """
from s2c2a.integrations.teleoperation.device import Button, DeviceInput

class Short:
    help = "a short motion"
    def __init__(self, speed):
        self.inputs = [
            DeviceInput((0.0, 0.0, 0.0), (Button.RECORD,)),
            *[DeviceInput((speed, 0.0, 0.0))] * 40,
            DeviceInput((0.0, 0.0, 0.0), (Button.RECORD,)),
        ]
    def __enter__(self): return self
    def __exit__(self, *error): pass
    def read(self):
        if not self.inputs:
            return DeviceInput((0.0, 0.0, 0.0), (Button.QUIT,))
        return self.inputs.pop(0)
"""


@pytest.mark.slow
def test_the_command_drives_a_simulated_arm_and_writes_the_file(tmp_path, capsys):
    (tmp_path / "short.py").write_text(SHORT)
    out = tmp_path / "demos.episodes"
    device = f"{tmp_path / 'short.py'}:Short"
    teleoperate.teleoperate("twin_arm", device, out, strategy="pcc")
    (episode,), _ = load_episodes(out)
    assert episode.options["strategy"] == "pcc · best"
    assert len(episode) >= 5
    assert "returns to rest" in capsys.readouterr().out


def test_a_missing_extra_is_named_before_the_arm_is_prepared(monkeypatch):
    monkeypatch.setattr("s2c2a.cli.execution.find_spec", lambda _: None)
    with pytest.raises(S2C2AError, match=r'pygame is missing.*"\.\[gamepad\]"'):
        teleoperate.teleoperate("no such arm", "gamepad")
