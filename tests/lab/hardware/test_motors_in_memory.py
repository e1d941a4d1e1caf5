"""The commands `motors` on emulated servos: torque, models, stored settings, silence."""

import os
import signal

import pytest
from homes import calibration_with
from servos_in_memory import IDS, START, Clock, ServosInMemory, arm_file, serve

from s2c2a.arm import load_arm, servos_of
from s2c2a.cli.interrupts import interrupts_as_exceptions
from s2c2a.errors import S2C2AError
from s2c2a.lab.cli import motors
from s2c2a.lab.hardware import timing
from s2c2a.lab.hardware.bring_up import MAX_LEAD
from s2c2a.lab.hardware.bus import BusError, StoredSettingsError, WrongModelError
from s2c2a.lab.hardware.buses import open_bus
from s2c2a.lab.hardware.calibration import save_calibration
from s2c2a.lab.hardware.presence import check_presence
from s2c2a.lab.hardware.servo_robot import DynamixelRobot
from s2c2a.runtime.emergency import EmergencyStopError

from marks import slow_after

PROTOCOLS = ("dynamixel", "feetech")
PING_ANSWER = 14  # bytes
TICK = 2 * 3.14159 * 0.01 / 4096  # m
GOALS = {"dynamixel": b"\x74\x00", "feetech": b"\x2a"}  # addresses
WRONG_MODELS = {"dynamixel": 1020, "feetech": 1029}
STATED = {
    "dynamixel": ("return_delay", "drive_mode", "operating_mode", "current_limit"),
    "feetech": ("min_position", "max_position", "max_torque", "operating_mode"),
}
needs_signals = pytest.mark.skipif(
    not hasattr(signal, "SIGUSR1"), reason="needs SIGUSR1"
)


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr("s2c2a.lab.hardware.bring_up.CURRENT_STEPS", (1.0,))


class Bench:
    """Servos in memory, an arm file, and the commands that drive them."""

    def __init__(self, folder, monkeypatch, protocol="dynamixel", **table):
        self.protocol = protocol
        self.clock = Clock()
        self.port = ServosInMemory(self.clock, protocol)
        serve(self.port, monkeypatch)
        self.arm = arm_file(folder, protocol, **table)
        self.homes = folder / "homes.json"
        homes = dict.fromkeys(IDS, int(START) - 200)
        save_calibration(calibration_with(load_arm(self.arm), homes), self.homes)

    def run(self, verb):
        if verb == "home":
            self.port.taut = START - 400
        arm, port = self.arm, "fake"
        new = self.homes.with_name("new.json")
        runs = {
            "jog": lambda: motors.jog(2, 20.0, arm, port, True),
            "home": lambda: motors.home(arm, port, new, repeat=1, yes=True),
            "check": lambda: motors.check(arm, port, self.homes, True),
            "timing": lambda: motors.timing(arm, port, cycles=5, yes=True),
            "release": lambda: motors.release(arm, port),
        }
        runs[verb]()

    def stored(self):
        names = STATED[self.protocol]
        return [[servo[name] for name in names] for servo in self.port.servos]

    def while_moving(self, act):
        """Do something once some servo has moved by 1 mm; notes that it was done."""
        done = []

        def watch(_):
            moved = [abs(servo.state.ticks - START) for servo in self.port.servos]
            if not done and max(moved) > 0.001 / TICK:
                done.append(True)
                act()

        self.clock.sleepers.append(watch)
        return done

    def signal_while_moving(self, name):
        number = getattr(signal, name)
        return self.while_moving(lambda: os.kill(os.getpid(), number))


@pytest.fixture
def make_bench(tmp_path, monkeypatch):
    def make(protocol="dynamixel", **table):
        return Bench(tmp_path, monkeypatch, protocol, **table)

    return make


def attempt(bench, verb):
    """Run a verb; `check` finds no tension in motors without cables."""
    if verb != "check":
        return bench.run(verb)
    text = "check the cables .*since 2026-01-01 .*motors home --overwrite"
    with pytest.raises(S2C2AError, match=text):
        bench.run(verb)


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("verb", ["jog", "home", "check"])
def test_a_servo_whose_program_dies_has_its_goal_near_and_a_watchdog(
    make_bench, verb, protocol
):
    bench = make_bench(protocol)
    leads = []
    guarded = []

    def watch():
        leads.extend(map(bench.port.lead, bench.port.servos))
        for servo in bench.port.servos:
            has_none = protocol == "feetech"
            guarded.append(has_none or not servo.torque or servo["bus_watchdog"] != 0)

    bench.port.watch = watch
    attempt(bench, verb)
    assert all(guarded)
    assert 0.001 / TICK < max(leads) <= MAX_LEAD / TICK + 1


@pytest.mark.parametrize(("protocol", "noise"), [("dynamixel", 0.05), ("feetech", 0.0)])
def test_a_jog_in_small_steps_arrives_also_over_a_noisy_line(
    make_bench, protocol, noise
):
    bench = make_bench(protocol)
    bench.port.disturbances.values["corrupted"] = (noise,)
    bench.run("jog")
    assert bench.port[2].state.ticks - START == pytest.approx(0.020 / TICK, abs=9)


def test_a_jogged_servo_stops_and_holds_by_its_watchdog_afterwards(make_bench):
    bench = make_bench()
    bench.run("jog")
    bench.clock.sleep(0.5)
    assert bench.port[2].torque
    assert bench.port[2].watchdog_tripped
    bench.run("jog")  # and obeys again
    assert bench.port[2].state.ticks - START == pytest.approx(0.040 / TICK, abs=9)


@needs_signals
@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(
    ("protocol", "name", "error"),
    [
        ("dynamixel", "SIGUSR1", EmergencyStopError),
        ("feetech", "SIGUSR1", EmergencyStopError),
        ("dynamixel", "SIGINT", KeyboardInterrupt),
        ("dynamixel", "SIGTERM", KeyboardInterrupt),
    ],
)
@pytest.mark.parametrize("verb", ["jog", "home", "check"])
def test_a_signal_to_stop_or_to_end_releases_the_servos_in_every_verb(
    make_bench, verb, protocol, name, error
):
    bench = make_bench(protocol)
    sent = bench.signal_while_moving(name)
    with pytest.raises(error), interrupts_as_exceptions():
        bench.run(verb)
    assert sent
    assert not any(servo.torque for servo in bench.port.servos)


@needs_signals
def test_the_emergency_signal_holds_the_servos_where_they_are_if_so_configured(
    make_bench,
):
    bench = make_bench(on_emergency="hold")
    bench.signal_while_moving("SIGUSR1")
    with pytest.raises(EmergencyStopError, match="SIGUSR1"):
        bench.run("jog")
    assert bench.port[2].torque
    assert bench.port.lead(bench.port[2]) <= 1


@needs_signals
def test_an_emergency_stop_at_a_question_releases_the_modules_homed_before(
    make_bench, monkeypatch
):
    bench = make_bench()

    def confirm(text, yes):
        if "module 2" in text:
            os.kill(os.getpid(), signal.SIGUSR1)
        return True

    monkeypatch.setattr(motors, "_confirm", confirm)
    with pytest.raises(EmergencyStopError):
        bench.run("home")
    assert not any(servo.torque for servo in bench.port.servos)


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("verb", ["jog", "home", "check", "timing"])
def test_a_servo_of_another_model_is_refused_in_every_verb(make_bench, verb, protocol):
    bench = make_bench(protocol)
    bench.port[2]["model_number"] = WRONG_MODELS[protocol]
    torques = []
    bench.port.watch = lambda: torques.append(bench.port[2].torque)
    before = bench.stored()
    with pytest.raises(WrongModelError, match=rf"servo 2 .*{WRONG_MODELS[protocol]}"):
        bench.run(verb)
    assert bench.stored()[1] == before[1]
    assert not any(torques)


def test_a_robot_with_a_servo_of_another_model_does_not_open(make_bench):
    bench = make_bench()
    bench.port[2]["model_number"] = 1020
    robot = DynamixelRobot(load_arm(bench.arm), "fake", str(bench.homes))
    with pytest.raises(S2C2AError, match=r"servo 2 is .*xm430-w350"):
        robot.open()
    assert not any(servo.torque for servo in bench.port.servos)


def test_a_servo_of_another_model_is_not_set_up(make_bench):
    bench = make_bench()
    del bench.port.servos[1:]
    bench.port[1]["model_number"] = 1020
    with pytest.raises(WrongModelError, match="xm430-w350"):
        motors.setup(5, bench.arm, "fake", yes=True)
    assert bench.port.servos[0].id == 1


@pytest.mark.parametrize(
    ("protocol", "name", "value"),
    [("dynamixel", "current_limit", 500), ("feetech", "max_torque", 200)],
)
def test_a_smaller_stored_limit_is_kept_and_announced(
    make_bench, protocol, name, value
):
    bench = make_bench(protocol)
    bench.port[2][name] = value
    with pytest.warns(UserWarning, match=r"servo 2 stores a current limit of 0\."):
        bench.run("jog")
    assert bench.port[2][name] == value
    goal = {"dynamixel": "goal_current", "feetech": "torque_limit"}[protocol]
    assert bench.port[2][goal] == value


@pytest.mark.parametrize(
    ("protocol", "name", "text"),
    [
        ("dynamixel", "current_limit", "current_limit 1750 -> 600"),
        ("feetech", "max_torque", "max_torque 1000 -> 250"),
    ],
)
def test_a_stored_limit_is_lowered_to_that_of_the_arm_file_and_announced(
    make_bench, capsys, protocol, name, text
):
    bench = make_bench(protocol)
    bench.run("jog")
    lines = [line for line in capsys.readouterr().out.splitlines() if "EEPROM" in line]
    assert len(lines) == 1
    assert text in lines[0]
    assert bench.port[2][name] == int(text.split()[-1])
    bench.run("jog")
    assert "EEPROM" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("id", "name", "value", "change"),
    [
        (2, "homing_offset", 77, "homing_offset 77 -> 0"),
        (2, "startup", 3, "startup_configuration 3 -> 0"),
        (2, "secondary_id", 99, "secondary_id 99 -> 255"),
        (4, "secondary_id", 2, r"servos \[4\]: secondary_id 2 -> 255"),
    ],
)
def test_what_a_servo_must_not_store_is_changed_if_the_operator_agrees(
    make_bench, monkeypatch, id, name, value, change
):
    bench = make_bench()
    bench.port[id][name] = value
    before = bench.stored()
    with monkeypatch.context() as context:
        context.setattr(motors, "_confirm", lambda text, yes: "EEPROM" not in text)
        with pytest.raises(StoredSettingsError, match=change):
            bench.run("jog")
    assert bench.stored() == before
    assert bench.port[id][name] == value
    assert not bench.port[2].torque
    bench.run("jog")
    assert bench.port[id][name] == {"secondary_id": 255}.get(name, 0)
    assert bench.port[4].state.ticks == START


@pytest.mark.parametrize(("id", "ids"), [(2, [2]), (4, [2]), (4, [2, 4])])
def test_each_id_is_that_of_one_servo_after_noise_and_a_killed_program(
    make_bench, monkeypatch, id, ids
):
    bench = make_bench()
    bench.port[id]["secondary_id"] = 99 if id == 2 else 2
    bench.port[id]["torque_enable"] = 1
    bench.port[2]["current_limit"] = 1750
    bench.port[4]["current_limit"] = 300
    pings = []
    receive = bench.port._receive

    def lose_one_answer(data):
        pings.append(len(data) == 9 * PING_ANSWER)
        receive(
            data[: (id - 1) * PING_ANSWER] if pings[-1] and sum(pings) == 1 else data
        )

    monkeypatch.setattr(bench.port, "_receive", lose_one_answer)
    with open_bus(servos_of(load_arm(bench.arm)), "fake") as bus:
        bus.accept_stored = lambda changes: True
        bus.prepare(ids, 0.6, 1.0)
    assert any(pings)
    assert bench.port[4]["current_limit"] == 300
    assert bench.port[id]["secondary_id"] == 255
    assert not bench.port[id].torque


def test_a_scan_lists_every_servo_and_which_one_obeys_another_id(make_bench, capsys):
    bench = make_bench()
    bench.port[4]["secondary_id"] = 2
    motors.scan(bench.arm, "fake")
    text = capsys.readouterr().out
    assert text.count("xl330-m288") == 9
    assert "module 3, cable 3" in text
    assert "servo 4 also obeys id 2 (its secondary id)" in text


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("verb", ["jog", "home", "check"])
def test_a_servo_that_restarts_ends_every_verb_and_is_named(make_bench, verb, protocol):
    bench = make_bench(protocol)
    restarted = bench.while_moving(lambda: bench.port[2].restart(bench.clock.now))
    with pytest.raises(BusError, match=r"servo 2 \(module 1, cable 2\) has restarted"):
        bench.run(verb)
    assert restarted
    assert not bench.port[2].torque


@pytest.fixture(params=PROTOCOLS)
def prepared(request, make_bench):
    """Bench and bus, after its second servo was prepared and sent a goal."""
    bench = make_bench(request.param)
    with open_bus(servos_of(load_arm(bench.arm)), "fake") as bus:
        bus.accept_stored = lambda changes: True
        bus.prepare([2], 0.6, 1.0)
        bus.send_goals({2: int(START) + 200})
        yield bench, bus


def test_a_servo_that_restarts_before_it_is_switched_on_stays_off(prepared):
    bench, bus = prepared
    bench.port[2].restart(bench.clock.now)
    with pytest.raises(BusError, match="servo 2 has restarted"):
        bus.set_torque([2], on=True)
    assert not bench.port[2].torque


def test_a_servo_is_switched_on_with_a_confirmed_goal_and_off_without_any(prepared):
    bench, bus = prepared
    address = GOALS[bench.protocol]
    bench.port.loses = lambda packet: packet.parameters.startswith(address)
    with pytest.raises(BusError, match="servo 2 on fake does not answer"):
        bus.set_torque([2], on=True)
    assert not bench.port[2].torque
    bench.port[2]["torque_enable"] = 1
    bus.set_torque([2], on=False)
    assert not bench.port[2].torque


def test_a_goal_counts_although_an_answer_before_it_was_lost(prepared, monkeypatch):
    bench, bus = prepared

    def lose_answer():
        with monkeypatch.context() as line:
            line.setattr(bench.port, "_receive", lambda data: None)
            assert bus.read_states([2]) == {}

    lose_answer()
    bus.send_goals({2: int(START)})
    bus.set_torque([2], on=True)
    assert bench.port[2].command().goal == START
    lose_answer()
    bus.send_goals({2: int(START) + 100})
    # a Feetech servo may be restarting, and a goal would switch it on
    sent = {"dynamixel": START + 100, "feetech": START}
    assert bench.port[2].command().goal == sent[bench.protocol]


def test_one_answer_like_that_of_a_restarted_servo_switches_nothing_off(prepared):
    bench, bus = prepared
    bus.set_torque([2], on=True)
    servo = bench.port[2]
    name = {"dynamixel": "status_return_level", "feetech": "goal_speed"}[bench.protocol]
    kept = servo[name]
    servo[name] = 1
    bench.port.watch = lambda: servo.__setitem__(name, kept)
    assert bus.read_states([2]).keys() == {2}
    assert servo.torque
    assert not bus.restarted


def test_a_declined_limit_stays_and_the_servo_moves(make_bench, monkeypatch):
    bench = make_bench()
    bench.port[2]["operating_mode"] = 5
    monkeypatch.setattr(motors, "_confirm", lambda text, yes: "EEPROM" not in text)
    bench.run("jog")
    assert bench.port[2]["current_limit"] == 1750
    assert bench.port[2]["goal_current"] == 600


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_bus_that_asks_nobody_changes_no_stored_setting(make_bench, protocol):
    bench = make_bench(protocol)
    before = bench.stored()
    with (
        open_bus(servos_of(load_arm(bench.arm)), "fake") as bus,
        pytest.raises(StoredSettingsError, match="nothing was changed"),
    ):
        bus.prepare(IDS, 0.6, 1.0)
    assert bench.stored() == before


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("verb", ["jog", "home", "check", "timing", "release"])
@pytest.mark.parametrize(
    ("silent", "text"),
    slow_after(
        1,
        [
            ([2], r"no answer from servo 2 \(module 1, cable 2\)"),
            (IDS, r"none of the 9 servos answers.*baud rate"),
        ],
    ),
)
def test_one_silent_servo_is_named_and_a_silent_bus_told_apart(
    make_bench, silent, text, verb, protocol
):
    bench = make_bench(protocol)
    bench.port.silence(silent)
    with pytest.raises(BusError, match=text):
        bench.run(verb)
    assert not any(servo.torque for servo in bench.port.servos)


@pytest.mark.slow
@pytest.mark.parametrize("overlaps", [False, True])
@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("verb", ["jog", "home", "check", "timing"])
def test_two_servos_with_one_id_are_told_apart(make_bench, verb, protocol, overlaps):
    bench = make_bench(protocol)
    bench.port.overlaps = overlaps
    twin = bench.port[2]
    other = bench.port[3]
    other["id"] = 2
    assert twin is not other
    other.state = type(other.state)(ticks=2345.0, voltage=bench.port.protocol.supply)
    text = "damaged answers" if overlaps else "more than one answer"
    with pytest.raises(BusError, match=rf"{text} from servo 2 .*setup"):
        bench.run(verb)
    assert not any(servo.torque for servo in bench.port.servos)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_answers_that_are_late_are_no_second_servo(make_bench, protocol):
    bench = make_bench(protocol)
    bench.port.lags = True
    with open_bus(servos_of(load_arm(bench.arm)), "fake") as bus:
        check_presence(bus, IDS, str)


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("verb", ["jog", "home", "check"])
def test_a_motion_ends_where_the_program_stood_still(
    make_bench, monkeypatch, verb, protocol
):
    bench = make_bench(protocol)
    slept = bench.while_moving(lambda: None)
    monkeypatch.setattr(
        "s2c2a.lab.hardware.motion_watch.time_with_sleep",
        lambda: bench.clock.now + 30.0 * len(slept),
    )
    with pytest.raises(S2C2AError, match=r"stood still for 30\.\d s"):
        bench.run(verb)
    assert slept
    assert not any(servo.torque for servo in bench.port.servos)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_scan_lists_servos_and_tells_silent_and_doubled_ones_apart(
    make_bench, capsys, protocol
):
    bench = make_bench(protocol)
    bench.port.silence([2])
    bench.port[9]["id"] = 8
    motors.scan(bench.arm, "fake")
    text = capsys.readouterr().out
    assert "module 1, cable 1" in text
    assert "no answer from servo 2 (module 1, cable 2), 9 (module 3, cable 3)" in text
    assert "more than one answer from servo 8" in text


def test_timing_ends_with_a_verdict(make_bench, capsys):
    make_bench().run("timing")
    assert "ok: the bus is fit for 50 Hz" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gone", "text"),
    [
        ([2], r"servo 2 \(module 1, cable 2\) is missing in 5 of 5 cycles"),
        (IDS, "none of the 9 servos answers in any cycle"),
    ],
)
def test_timing_fails_where_servos_do_not_answer(
    make_bench, capsys, monkeypatch, gone, text
):
    bench = make_bench()

    measure = timing.measure_timing

    def lose_and_measure(*arguments):
        bench.port.silence(gone)
        return measure(*arguments)

    monkeypatch.setattr(timing, "measure_timing", lose_and_measure)
    with pytest.raises(S2C2AError, match=text):
        bench.run("timing")
    assert "in 5 a servo did not answer" in capsys.readouterr().out
