"""The bus against scripted servos."""

from functools import partial
from math import pi

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from s2c2a.lab.emulation.feetech_protocol import pack
from s2c2a.lab.hardware.bus import (
    BusError,
    HardwareError,
    ServoInfo,
)
from s2c2a.lab.hardware.feetech import FeetechBus


def prepared(bus, *ids):
    bus.prepare(ids, current=0.6, speed=3.0)


def test_a_state_is_converted_to_si_units(bus, port):
    port[1].set(56, 0x01, 0x80)  # position -1
    port[1].set(58, 0x00, 0x04)  # 1024 steps/s
    port[1].set(60, 0x64, 0x04)  # load -100
    port[1].set(62, 74, 41)
    port[1].set(69, 100, 0)
    prepared(bus, 1)
    state = bus.read_states([1])[1]
    assert state.position == -1
    assert state.velocity == pytest.approx(pi / 2)
    assert state.current == pytest.approx(-0.65)
    assert state.voltage == pytest.approx(7.4)
    assert state.temperature == 41
    assert state.errors == frozenset()


def test_all_states_come_from_one_packet(bus, port):
    assert list(bus.read_states([1, 2, 3])) == [1, 2, 3]
    assert port.sent == [pack(0xFE, 0x82, bytes((46, 25, 1, 2, 3)))]


def flip_a_bit(place, answer):
    data = bytearray(answer)
    data[place] ^= 0x10
    return bytes(data)


def announce_a_byte_more(answer):
    """Change the length, and let the checksum fit."""
    body = bytes((answer[2], answer[3] + 1)) + answer[4:-1]
    return answer[:2] + body + bytes((~sum(body) & 0xFF,))


@pytest.mark.parametrize("damaged", [1, 2, 3])
@pytest.mark.parametrize(
    "spoil",
    [
        *(partial(flip_a_bit, place) for place in (0, 1, 2, 3, 4, 5, -1)),
        lambda answer: answer[:4] + answer[5:],
        lambda answer: answer[:-3],
        lambda answer: b"",
        lambda answer: b"\xff\xff" + answer[2:10] + b"\xff\xff\x01\x11",
        lambda answer: b"\x00" * 50,
        lambda answer: pack(9, 0, answer[5:-1]),
        announce_a_byte_more,
    ],
)
def test_a_damaged_answer_costs_only_itself(bus, port, damaged, spoil):
    port.spoil[damaged] = spoil
    assert set(bus.read_states([1, 2, 3])) == {1, 2, 3} - {damaged}


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(answers=st.lists(st.binary(max_size=60), min_size=3, max_size=3))
def test_random_answers_give_no_states(bus, port, answers):
    port.spoil = {id: lambda _, i=id: answers[i - 1] for id in (1, 2, 3)}
    assert bus.read_states([1, 2, 3]) == {}


@pytest.mark.parametrize(
    "noise",
    [
        b"\x00\xff\x13",
        b"\xff",
        b"\xff\xff",
        b"\xff\xff\x02\x11\x00",
        b"\xff\xff\x02\x1b",
        pack(2, 0, bytes(25))[:-1],
        b"\x7f" * 9,
    ],
)
def test_garbage_before_an_answer_is_skipped(bus, port, noise):
    port.spoil[2] = lambda answer: noise + answer
    assert set(bus.read_states([1, 2, 3])) == {1, 2, 3}


def test_an_answer_to_an_earlier_packet_is_not_taken(bus, port):
    port._received += pack(1, 0, bytes(25))
    port.servos.remove(port[1])
    assert bus.read_states([1]) == {}


def test_an_echo_of_the_adapter_is_no_answer(bus, port):
    port.echoes = True
    prepared(bus, 1, 2, 3)
    port.spoil[2] = lambda answer: b""
    assert set(bus.read_states([1, 2, 3])) == {1, 3}
    assert [info.id for info in bus.scan(range(5))] == [1, 3]


def test_errors_come_from_the_answer_and_the_status_register(bus, port):
    port.spoil[1] = lambda answer: pack(1, 1 | 32, answer[5:-1])
    port[1].set(65, 4 | 2)
    assert bus.read_states([1])[1].errors == {
        HardwareError.VOLTAGE,
        HardwareError.OVERLOAD,
        HardwareError.OVERHEATED,
        HardwareError.ENCODER,
    }


def test_turns_are_reported_by_prepared_servos(bus, port):
    prepared(bus, 1)
    port[1].set(56, 0x00, 0x50)
    assert bus.read_states([1])[1].position == 5 * 4096


def test_turns_are_counted_for_servos_that_report_one_turn_only(bus, port):
    port[1].takes_full_angle = False
    prepared(bus, 1)
    positions = []
    for data in (b"\xf0\x0f", b"\x10\x00", b"\xf0\x0f", b"\x10\x08"):
        port[1].set(56, *data)
        positions.append(bus.read_states([1])[1].position)
    assert positions == [4080, 4112, 4080, 2064]


def test_preparing_again_forgets_the_turns(bus, port):
    port[1].takes_full_angle = False
    port[1].set(56, 0xF0, 0x0F)
    bus.read_states([1])
    port[1].set(56, 0x10, 0x00)
    assert bus.read_states([1])[1].position == 4112
    prepared(bus, 1)
    assert bus.read_states([1])[1].position == 16


def test_a_prepared_servo_has_mode_limits_and_no_torque(bus, port):
    port[1].set(40, 1)
    prepared(bus, 1)
    memory = port[1].memory
    assert memory[7:9] == b"\x00\x01"
    assert memory[9:13] == bytes(4)
    assert memory[18] == 12 | 16
    assert memory[33] == 0
    assert memory[40] == 0
    assert int.from_bytes(memory[46:48], "little") == int(3.0 * 4096 / (2 * pi))
    assert int.from_bytes(memory[48:50], "little") == 250  # 0.6 A of 2.4 A
    assert memory[55] == 1


def test_a_coarse_unit_of_speed_is_respected(bus, port):
    port[1].set(18, 0)
    port[1].set(58, 2)
    prepared(bus, 1)
    assert int.from_bytes(port[1].memory[46:48], "little") == 39  # 50 steps/s
    velocity = bus.read_states([1])[1].velocity
    assert velocity == pytest.approx(100 * 2 * pi / 4096)


def test_settings_that_are_right_are_not_written_again(bus, port):
    prepared(bus, 1)
    port.sent.clear()
    prepared(bus, 1)
    addresses = [sent[5] for sent in port.sent if sent[4] == 0x03]
    assert min(addresses) >= 40


def test_the_current_limit_never_exceeds_the_stall_current(bus, port):
    bus.set_current([1, 2], 100.0)
    assert port[2].memory[48:50] == b"\xe8\x03"


@pytest.mark.parametrize("current", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_current_limit_is_rejected(bus, port, current):
    with pytest.raises(BusError, match="positive"):
        bus.set_current([1], current)
    assert port.sent == []


def test_the_12_volt_model_has_its_own_torque_constant(port):
    bus = FeetechBus("fake", 1_000_000, "sts3215-12v")
    assert bus.torque_constant == pytest.approx(30 * 0.0980665 / 2.7)


def test_goals_are_one_packet_without_an_answer(bus, port):
    bus.send_goals({1: 4096, 2: -1})
    assert port.sent == [bytes.fromhex("ffff fe0a832a02 010010 020180 b4")]
    assert port.in_waiting == 0


def test_an_impossible_goal_is_rejected_before_anything_is_sent(bus, port):
    with pytest.raises(BusError, match="32767"):
        bus.send_goals({1: 0, 2: 40_000})
    assert port.sent == []


def test_a_goal_never_switches_a_released_servo_on(bus, port):
    bus.set_torque([1], False)
    bus.send_goals({1: 100, 2: 200})
    assert port[1].memory[40] == 0
    assert port[2].memory[42:44] == b"\xc8\x00"
    bus.set_torque([1], True)
    assert port[1].memory[40] == 1
    assert port[1].memory[42:44] == b"\x64\x00"


def test_a_servo_that_is_switched_on_stays_where_it_is(bus, port):
    bus.set_torque([1], False)
    port[1].set(42, 0x00, 0x08)  # an old goal
    port[1].set(56, 0x34, 0x02)
    bus.set_torque([1], True)
    assert port[1].memory[42:44] == b"\x34\x02"


def test_all_servos_are_switched_off_although_one_is_absent(bus, port):
    bus.set_torque([1, 2, 3], True)
    port.servos.remove(port[2])
    with pytest.raises(BusError, match="servo 2 on fake does not answer"):
        bus.set_torque([1, 2, 3], False)
    assert port[1].memory[40] == port[3].memory[40] == 0


def test_a_write_is_repeated_after_a_damaged_answer(bus, port):
    answers = iter((b"", b"\xff\xff\x01"))
    port.spoil[1] = lambda answer: next(answers, answer)
    bus.set_current([1], 1.2)
    assert len(port.sent) == 3


def test_a_scan_finds_the_servos_that_answer_also_of_an_unknown_model(bus, port):
    port[2].set(3, 1, 1)
    assert bus.scan([1, 2, 9]) == [
        ServoInfo(1, 777, "sts3215", 310),
        ServoInfo(2, 257, "unknown", 310),
    ]


@pytest.mark.parametrize(
    ("changes_at_once", "rate", "code"),
    [(True, 500_000, 1), (False, 500_000, 1), (True, 1_000_000, 0)],
)
def test_a_servo_gets_another_id_and_rate(bus, port, changes_at_once, rate, code):
    port[1].changes_rate_at_once = changes_at_once
    bus.assign(1, 7, rate)
    assert port[7].memory[55] == 1
    port[7].restart(0.0)  # forgets what was written while it was locked
    assert port[7].memory[6] == code
    assert port.baudrate == 1_000_000
    bus.set_baud_rate(rate if changes_at_once else 1_000_000)
    assert [info.id for info in bus.scan([1, 7])] == [7]


@pytest.mark.parametrize(
    ("id", "new_id", "rate", "message"),
    [
        (1, 2, 1_000_000, "another servo"),
        (1, 253, 1_000_000, "choose 0 to 252"),
        (1, 9, 9600, "no baud rate"),
        (8, 9, 1_000_000, "does not answer"),
        (3, 9, 1_000_000, "torque of servo 3 is on"),
    ],
)
def test_an_impossible_assignment_is_rejected(bus, port, id, new_id, rate, message):
    port[3].set(40, 1)
    with pytest.raises(BusError, match=message):
        bus.assign(id, new_id, rate)
    assert port[1].memory[55] == 1


def test_a_reboot_switches_the_torque_off(bus, port):
    port[1].set(40, 1)
    bus.reboot(1)
    assert port[1].memory[40] == 0


def test_a_reboot_names_the_error_that_remains(bus, port):
    port[1].set(65, 4)
    with pytest.raises(BusError, match="overheated"):
        bus.reboot(1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("fake", 1_000_000, "xl330"), "choose one of sts3215"),
        (("fake", 9600), "choose one of 1000000"),
    ],
)
def test_an_unknown_model_or_rate_is_rejected(port, arguments, message):
    with pytest.raises(BusError, match=message):
        FeetechBus(*arguments)


def test_servos_have_no_watchdog(bus):
    assert not bus.has_watchdog
    with pytest.raises(BusError, match="no watchdog"):
        bus.arm_watchdog([1], 0.4)
