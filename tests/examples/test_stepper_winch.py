"""The stepper winch of the examples, with its sketch emulated on a pseudo-terminal."""

import math
import os
import re
import shutil
import subprocess
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import load_arm, save_arm
from s2c2a.cli.main import main
from s2c2a.errors import RobotError, S2C2AError
from s2c2a.lab.hardware.bus import BusError, PortLostError
from s2c2a.robots.factory import robot_class
from s2c2a.runtime import Loop
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.runtime.player import Player, play

FOLDER = Path(__file__).parents[2] / "examples" / "extending"
ROBOT = f"{FOLDER / 'own_stepper.py'}:StepperWinch"
SKETCH = FOLDER / "stepper_winch" / "stepper_winch.ino"
LOOP_TIME = 500  # us, also of `sketch_on_host.cpp`
STEP = 2 * np.pi * 0.01 / 1600  # m


def constant(name):
    """A constant of the sketch."""
    (number,) = re.findall(rf"\b{name} = (-?[\d.]+);", SKETCH.read_text("utf-8"))
    return float(number)


MOTORS = int(constant("MOTORS"))
LOW, HIGH = int(constant("LOW_LIMIT")), int(constant("HIGH_LIMIT"))
SPEED = constant("SPEED")
ACCELERATION = constant("ACCELERATION")
GAIN = constant("GAIN")
WATCHDOG = constant("WATCHDOG")


class Board:
    """What the sketch does, with its constants, in a time of its own [us]."""

    def __init__(self, motors=MOTORS, speed=SPEED):
        self.now = 0
        self.speed = speed
        self.is_homed = False
        self._is_moving = False
        self._commanded_at = self._moved_at = 0
        self._changed_at = [0] * motors
        self._changing = 0
        self.motors = motors
        self._at_zero()

    def _at_zero(self):
        self.positions = np.zeros(self.motors, int)
        self._targets = np.zeros(self.motors, int)
        self.speeds = np.zeros(self.motors)
        self._fractions = np.zeros(self.motors)

    def advance(self, until):
        """Do what `loop` does until a time."""
        while self.now < until:
            self._loop()
            self.now += LOOP_TIME

    def hear(self, line):
        """Obey one line; return the answer, empty for none."""
        if line == "?":
            return self.answer()
        if line == "S":
            self._is_moving = False
        if line == "H":
            self._at_zero()
            self._is_moving = False
            self.is_homed = True
        if self.is_homed and re.fullmatch(rf"M( -?\d+){{{self.motors + 1}}}", line):
            *numbers, total = map(int, line.split()[1:])
            if sum(numbers) == total:
                self._targets = np.clip(numbers, LOW, HIGH)
                self._is_moving = True
                self._commanded_at = self.now
        return ""

    def answer(self):
        if not self.is_homed:
            return "U\r\n"
        numbers = [*self.positions.tolist(), int(self.positions.sum())]
        return f"P {' '.join(map(str, numbers))}\r\n"

    def _loop(self):
        if self.now - self._commanded_at > WATCHDOG:
            self._is_moving = False
        self._change_speed()
        self._fractions += self.speeds * 1e-6 * (self.now - self._moved_at)
        self._moved_at = self.now
        ways = np.trunc(np.clip(self._fractions, -1, 1)).astype(int)
        self._fractions -= ways
        inside = (self.positions + ways >= LOW) & (self.positions + ways <= HIGH)
        self.speeds *= inside
        self.positions += ways * inside

    def _change_speed(self):
        """Change the speed of one motor, the next of all."""
        one = self._changing = (self._changing + 1) % self.motors
        most = 1e-6 * ACCELERATION * (self.now - self._changed_at[one])
        self._changed_at[one] = self.now
        distance = self._targets[one] - self.positions[one]
        wanted = wanted_speed(distance, self.speed) if self._is_moving else 0.0
        self.speeds[one] += np.clip(wanted - self.speeds[one], -most, most)


def wanted_speed(distance, most):
    length = abs(distance)
    last = ACCELERATION / GAIN**2
    speed = GAIN * length
    if length > last:
        speed = math.sqrt(2 * ACCELERATION * (length - last / 2))
    return math.copysign(min(speed, most), distance)


class Emulator(threading.Thread):
    """A board on a pseudo-terminal, in real time.

    Attributes:
        port: its name.
        garble: changes the answers.
    """

    def __init__(self, board):
        super().__init__(daemon=True)
        self.board = board
        self.garble = str
        self.commands = 0
        self._file, self._other = os.openpty()
        tty.setraw(self._other)
        os.set_blocking(self._file, False)
        self.port = os.ttyname(self._other)
        self._is_plugged = True
        self._ended = threading.Event()

    def run(self):
        heard = b""
        begun = time.perf_counter()
        while not self._ended.wait(0.001):
            self.board.advance(1e6 * (time.perf_counter() - begun))
            *lines, heard = (heard + self._read()).split(b"\n")
            for line in lines:
                self.commands += line.startswith(b"M")
                answer = self.board.hear(line.decode())
                if answer:
                    os.write(self._file, self.garble(answer).encode())

    def unplug(self):
        """The port disappears; the board goes on."""
        self._is_plugged = False
        time.sleep(0.01)
        os.close(self._other)
        os.close(self._file)

    def end(self):
        if self._is_plugged:
            self.unplug()
        self._ended.set()
        self.join()

    def _read(self):
        try:
            return os.read(self._file, 1000) if self._is_plugged else b""
        except OSError:
            return b""


@pytest.fixture
def emulator():
    emulator = Emulator(Board())
    emulator.start()
    yield emulator
    emulator.end()


@pytest.fixture(scope="module")
def arm():
    """An arm with time for an answer on a busy computer."""
    return load_arm("planar_finger").model_copy(update={"control_rate": 2.0})


@pytest.fixture(scope="module")
def fast_arm():
    return load_arm("planar_finger").model_copy(update={"control_rate": 5.0})


def winch(arm, emulator, **options):
    return robot_class(ROBOT)(arm, port=emulator.port, home=True, **options)


def bend(share, arm):
    """An action that winds in the first cable of each module and pays out the second."""
    return np.tile([-share, share], (arm.module_count, 1))


def drive(robot, event):
    """Let the control loop bend the arm for 20 s; something happens after 2 s."""
    far = [bend(share, robot.arm) for share in np.linspace(0, 0.008, 100)]
    player = Player(robot.arm, (), iter(far))
    with Loop(robot, player) as loop:
        for number, _ in enumerate(play(loop, player)):
            if number == 10:
                event()


def test_the_winch_fulfills_the_interface_contract(
    emulator, fast_arm, tmp_path, capsys
):
    path = tmp_path / "arm.toml"
    save_arm(fast_arm.model_copy(update={"name": "own_arm"}), path)
    options = ["--robot-option", f"port={emulator.port}", "home=1"]
    main(["robot", "check", "--robot", ROBOT, "--arm", str(path), *options])
    output = capsys.readouterr().out
    assert "ok: the arm moves as commanded" in output
    assert "fulfills the interface contract" in output


@pytest.mark.slow
def test_readings_are_the_steps_that_the_board_counts(emulator, arm):
    with winch(arm, emulator) as robot:
        sent = robot.send(bend(0.002, arm))
        time.sleep(0.3)
        np.testing.assert_allclose(robot.read()["cables"], sent)
        np.testing.assert_allclose(sent, bend(round(0.002 / STEP) * STEP, arm))
        assert emulator.board.positions.tolist() == [-51, 51, -51, 51]


def test_a_board_that_has_just_started_is_homed_by_hand_first(emulator, arm):
    robot = robot_class(ROBOT)(arm, port=emulator.port)
    with pytest.raises(RobotError, match=r"straighten the arm by hand.*home=1"):
        robot.open()
    robot.close()
    assert emulator.commands == 0


@pytest.mark.slow
def test_a_board_that_restarts_during_a_run_gives_no_readings(emulator, arm):
    with winch(arm, emulator) as robot:
        emulator.board.is_homed = False
        reading = robot.read()
        assert "has just started" in reading.fault
        assert np.isnan(reading["cables"]).all()
        with pytest.raises(RobotError, match="has just started"):
            robot.open()


@pytest.mark.slow
def test_a_second_opening_returns_slowly_to_rest(emulator, arm):
    with winch(arm, emulator) as robot:
        robot.send(bend(0.0005, arm))
        time.sleep(0.3)
        assert emulator.board.positions.any()
        commands = emulator.commands
        np.testing.assert_allclose(robot.open()["cables"], 0.0)
        assert emulator.commands > commands + 75


DAMAGED = [
    (lambda answer: answer.replace("1", "7", 1), "damaged answer: 'P -5"),
    (lambda answer: answer.replace("P", "Q"), "damaged"),
    (lambda answer: "\x00\xff~\r\n", "damaged"),
    (lambda answer: "\r\n", "does not answer"),
    (lambda answer: answer[:-1], "does not answer"),
    (lambda answer: answer + "P -5", "does not answer"),
    (lambda answer: "P 1 1\r\n", "1 motors and 'planar_finger' 4 cables"),
    (lambda answer: "", "does not answer"),
]


@pytest.mark.slow
def test_a_damaged_answer_is_no_reading(emulator, arm):
    with winch(arm, emulator) as robot:
        robot.send(bend(0.002, arm))
        time.sleep(0.3)
        for garble, match in DAMAGED:
            emulator.garble = garble
            reading = robot.read()
            assert re.search(match, reading.fault)
            assert np.isnan(reading["cables"]).all()
        emulator.garble = str
        reading = robot.read()
        assert reading.fault == ""
        assert np.isfinite(reading["cables"]).all()


@pytest.mark.slow
def test_a_lost_port_ends_the_run_and_the_motors_brake(emulator, fast_arm):
    with pytest.raises(S2C2AError, match=r"is gone.*check the cable") as caught:
        drive(winch(fast_arm, emulator), emulator.unplug)
    assert emulator.port in str(caught.value)
    time.sleep(1e-6 * WATCHDOG + 0.3)
    assert not emulator.board.speeds.any()
    assert emulator.board.positions.any()


@pytest.mark.slow
def test_a_lost_port_is_opened_anew(emulator, arm):
    robot = winch(arm, emulator)
    robot.open()
    emulator.unplug()
    with pytest.raises(PortLostError):
        robot.read()
    robot.close()
    with pytest.raises(BusError, match="cannot be opened"):
        robot.open()
    with pytest.raises(RobotError, match="is not open"):
        robot.send(bend(0.0, arm))


@pytest.mark.slow
def test_a_halt_brakes_the_motors_before_the_watchdog_does(emulator, arm):
    emulator.board.speed = SLOW
    with winch(arm, emulator) as robot:
        robot.send(bend(0.008, arm))
        time.sleep(0.1)
        robot.halt()
        time.sleep(0.15)
        assert emulator.board.positions.any()
        assert not emulator.board.speeds.any()


def test_opening_moves_nothing_after_an_emergency_stop(emulator, arm):
    EMERGENCY_STOP.trigger()
    with pytest.raises(EmergencyStopError):
        winch(arm, emulator).open()
    assert emulator.commands == 0


def test_a_port_without_the_sketch_is_reported(arm, monkeypatch):
    make = robot_class(ROBOT)
    monkeypatch.setitem(make._wait_for_board.__globals__, "BOOT_TIME", 0.1)
    other, port = os.openpty()
    robot = make(arm, port=os.ttyname(port))
    with pytest.raises(RobotError, match=r"nothing answered.*stepper_winch"):
        robot.open()
    robot.close()
    for end in (other, port):
        os.close(end)


def test_an_arm_that_takes_no_displacements_is_refused():
    with pytest.raises(RobotError, match='actuation = "pressure"'):
        robot_class(ROBOT)(load_arm("pneumatic_arm"), port="/dev/null")


def test_a_turn_without_steps_is_refused(arm):
    with pytest.raises(RobotError, match="steps_per_turn is 0; give"):
        robot_class(ROBOT)(arm, port="/dev/null", steps_per_turn=0)


def total(numbers):
    return " ".join(map(str, ["M", *numbers, sum(numbers)]))


def played(board, script):
    """The answers of a board to lines at times [us]."""
    answers = []
    for moment, line in script:
        board.advance(moment)
        answers.append(board.hear(line))
        board.advance(board.now + LOOP_TIME)
    return [answer.split() for answer in answers if answer]


def positions_in(answers):
    known = [words[1:-1] for words in answers if words[0] == "P"]
    return np.array(known).astype(int)


def asked(until, script):
    """A script with a question every 10 ms."""
    questions = [(moment, "?") for moment in range(5_000, until, 10_000)]
    return sorted([*script, *questions])


FAR = [10_000, -10_000, 120, -40]
HOMED = (0, "H")
SLOW = 200.0  # steps/s; the way to a limit takes longer than the watchdog
WRONG_LINES = (
    "M 300 0 0 0 30|M 300 0 0 0|M 300 0 0 0 0 300|M 300 0 0 0 300 |M300 0 0 0 300|"
    f"M 3x0 0 0 0 300|m 300 0 0 0 300|M 300 0 0 0 300{' ' * 200}||SS"
).split("|")
SCRIPTS = {
    "targets beyond the limits": asked(
        900_000, [HOMED, *[(time, total(FAR)) for time in range(0, 900_000, 100_000)]]
    ),
    "the watchdog": asked(1_500_000, [HOMED, (100_000, total([300, -300, 2, -1]))]),
    "a command in time": asked(
        1_500_000,
        [HOMED, (0, total([300, -300, 2, -1])), (450_000, total([300, 5, 5, 5]))],
    ),
    "a stop": asked(
        600_000, [HOMED, (1_000, total([300, -300, 9, 0])), (100_000, "S")]
    ),
    "a reversal": asked(
        900_000,
        [HOMED, (0, total([300, 90, 50, 0])), (150_000, total([-300, -90, 0, 0]))],
    ),
    "no home": asked(300_000, [(1_000, total([300, 0, 0, 0]))]),
    "damaged lines": asked(
        400_000,
        [
            HOMED,
            *[(1_000 * number, line) for number, line in enumerate(WRONG_LINES, 1)],
        ],
    ),
}


def test_limits_of_travel_speed_and_acceleration_hold():
    positions = positions_in(played(Board(), SCRIPTS["targets beyond the limits"]))
    assert positions[-1].tolist() == [HIGH, LOW, 120, -40]
    assert positions.max() == HIGH
    assert positions.min() == LOW
    speeds = np.diff(positions, axis=0) / 0.01
    assert np.abs(speeds).max() <= SPEED + 100.0  # one step in 10 ms
    changes = np.abs(np.diff(speeds, axis=0)) / 0.01
    assert changes.max() <= ACCELERATION + 20_000.0  # two steps in (10 ms)^2


def test_motors_brake_without_commands_for_half_a_second():
    positions = positions_in(played(Board(speed=SLOW), SCRIPTS["the watchdog"]))
    assert 90 < positions[-1][0] < 110
    np.testing.assert_array_equal(positions[-1], positions[-50])


@pytest.fixture(scope="module", params=[SPEED, SLOW])
def sketch(request, tmp_path_factory):
    """The sketch with a speed, compiled for this computer, and that speed."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("g++ is not installed")
    program = tmp_path_factory.mktemp("sketch") / "sketch"
    text = SKETCH.read_text("utf-8")
    changed = re.sub(r"\bSPEED = [\d.]+;", f"SPEED = {request.param};", text)
    program.with_suffix(".ino").write_text(changed, "utf-8")
    source = Path(__file__).with_name("sketch_on_host.cpp")
    define = f'-DSKETCH="{program}.ino"'
    command = [compiler, "-Wall", "-Werror", define, source, "-o", program]
    subprocess.run(command, check=True, timeout=60)
    return program, request.param


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_the_emulator_follows_the_sketch(sketch, name):
    script = SCRIPTS[name]
    text = "".join(f"{moment} {line}\n" for moment, line in script)
    program, speed = sketch
    done = subprocess.run(
        [program], input=text, capture_output=True, text=True, check=True, timeout=20
    )
    lines = [line.split() for line in done.stdout.splitlines()]
    answers = [words for words in lines if words[0] != "pulses"]
    expected = played(Board(speed=speed), script)
    assert [words[0] for words in answers] == [words[0] for words in expected]
    # numbers of four bytes round to another step now and then
    positions = positions_in(answers)
    np.testing.assert_allclose(positions, positions_in(expected), atol=1)
    # pulses go out only where steps are counted, and to drivers that are on
    states = [words[1:] for words in lines if words[0] == "pulses"]
    assert states == [
        ["on", *words[1:-1]] if words[0] == "P" else ["off", *"0000"]
        for words in answers
    ]
