"""Faults of emulated servos."""

import numpy as np
import pytest
from homes import arm_with_servos

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from s2c2a.lab.emulation.fault_texts import Fault
from s2c2a.lab.emulation.faults import GRAMMAR, LineFaults, apply_fault
from s2c2a.lab.emulation.instructions import Reply

ARM = load_arm("twin_arm")
IDS = range(1, 10)


@pytest.fixture(scope="module")
def emulator(tmp_path_factory):
    link = tmp_path_factory.mktemp("servos") / "port"
    return Emulator(ARM, EmulatorOptions(homed=True, link=link))


def make_disturbances(kind, *values):
    disturbances = LineFaults(np.random.default_rng(0))
    disturbances.values[kind] = values
    return disturbances


def occur(emulator, *texts):
    """Let faults occur."""
    for fault in GRAMMAR.parse([f"0 {text}" for text in texts], IDS):
        apply_fault(fault, emulator)


def test_faults_are_parsed():
    faults = GRAMMAR.parse(["3 gone 4 1.5", "torque+0.5 lost 0.1"], IDS)
    assert faults == [
        Fault(0.5, "lost", (), (0.1,), after_torque=True),
        Fault(3.0, "gone", ("4",), (1.5,)),
    ]


@pytest.mark.parametrize(
    "text",
    [
        *("", "3", "gone 4", "-1 hot 2", "inf hot 2", "3 flood", "3 gone 4 1 2"),
        *("3 lost", "3 lost x", "3 lost nan", "3 lost 1.5", "3 lost 0.1 0.2"),
    ],
)
def test_an_invalid_fault_names_the_allowed_kinds(text):
    with pytest.raises(S2C2AError, match=r"late SECONDS SHARE.*gone ID \[SECONDS\]"):
        GRAMMAR.parse([text], IDS)


def test_a_fault_of_a_servo_that_does_not_exist_names_the_servos():
    with pytest.raises(S2C2AError, match=r"names servo 12; .* 1, 2, 3"):
        GRAMMAR.parse(["1 reboot 12"], IDS)


def test_a_lost_answer_still_takes_its_place_in_the_order():
    answers = [Reply(1, b"abc", 0.0), Reply(2, b"def", 0.0)]
    lost = make_disturbances("lost", 1.0).disturb(answers)
    assert [one.data for one in lost] == [b"", b""]


def test_a_corrupted_answer_has_one_flipped_bit():
    disturbances = make_disturbances("corrupted", 1.0)
    data = disturbances.disturb([Reply(1, bytes(9), 0.0)])[0].data
    assert sum(byte.bit_count() for byte in data) == 1


def test_a_late_answer_keeps_its_bytes():
    late = make_disturbances("late", 0.02, 1.0).disturb([Reply(1, b"abc", 0.001)])
    assert late == [Reply(1, b"abc", pytest.approx(0.021))]


def test_garbage_precedes_an_answer():
    data = make_disturbances("garbage", 1.0).disturb([Reply(1, b"abc", 0)])[0].data
    assert data.endswith(b"abc")
    assert 4 <= len(data) <= 11


def test_a_share_of_the_answers_is_hit_and_none_after_share_zero():
    disturbances = make_disturbances("lost", 0.3)
    answers = [Reply(1, b"abc", 0.0)] * 1000
    lost = sum(not one.data for one in disturbances.disturb(answers))
    assert 250 < lost < 350
    disturbances.values["lost"] = (0.0,)
    assert disturbances.disturb(answers) == answers


def test_faults_reach_servos_and_cables(emulator):
    emulator.now = 10.0
    occur(emulator, "gone 1 0.5", "reboot 2", "overload 3", "stalled 4", "snapped 5")
    occur(emulator, "stuffed 6", "voltage 4.0")
    servos = emulator.servos
    assert [servo.is_present(10.2) for servo in servos[:3]] == [False, False, True]
    assert servos[0].is_present(10.6)
    assert servos[2].errors == ("overload",)
    assert list(np.flatnonzero(emulator.plant.stalled)) == [3]
    assert list(np.flatnonzero(emulator.plant.snapped)) == [4]
    assert servos[5].read(132, 4) == b"\xff\xff\xfd\xff"
    emulator.advance_chunk()
    assert servos[7].read(144, 1) == b"\x28"


def test_a_hot_servo_shuts_down_within_seconds(emulator):
    servo = emulator.servos[8]
    occur(emulator, "hot 9")
    seconds = 0
    while not servo.errors and seconds < 60:
        servo.update(servo.state, 1.0, 0.0)
        seconds += 1
    assert servo.errors == ("overheating",)
    assert 2 < seconds < 20


def test_faults_wait_for_their_time_and_for_the_first_torque(tmp_path):
    faults = ("torque+1 overload 1", "4 overload 2")
    options = EmulatorOptions(faults=faults, link=tmp_path / "port")
    emulator = Emulator(ARM, options)
    servo, timed = emulator.servos[:2]
    errors = []
    for emulator.now in (0.0, 3.9, 5.0):
        emulator.serve()
        errors.append(timed.errors)
    assert errors == [(), (), ("overload",)]
    servo["torque_enable"] = 1
    for emulator.now in (6.0, 6.9):
        emulator.serve()
    assert not servo.errors
    emulator.now = 7.1
    emulator.serve()
    assert servo.errors == ("overload",)


def test_a_servo_without_stuffing_cannot_have_its_fault(tmp_path):
    arm = arm_with_servos(protocol="feetech", model="sts3215")
    options = EmulatorOptions(faults=("1 stuffed 1",), link=tmp_path / "port")
    with pytest.raises(S2C2AError, match="stuffed"):
        Emulator(arm, options)


def test_a_servo_states_another_model(emulator):
    occur(emulator, "model 3 1020")
    numbers = [servo["model_number"] for servo in emulator.servos]
    assert numbers[2] == 1020
    assert set(numbers[:2] + numbers[3:]) == {1200}


@pytest.mark.parametrize(("text", "doubled"), [("twin 4", False), ("twin 4 1", True)])
def test_a_twin_answers_too(emulator, text, doubled):
    occur(emulator, text)
    measured, identity = bytes(range(100, 130)), bytes(range(12))
    answers = [Reply(4, measured, 0.0), Reply(4, identity, 0.0)]
    other = Reply(5, measured, 0.0)
    heard = emulator.disturbances.disturb([*answers, other])
    emulator.disturbances.twins.clear()
    repeats = 1 + doubled
    assert heard[1].data == repeats * identity
    assert heard[0].data.startswith(measured[:9])
    # two servos measure different values, which damage each other
    assert (heard[0].data == repeats * measured) == doubled
    assert heard[2] == other
