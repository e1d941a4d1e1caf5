"""Plausibility check of readings: every fault is described, sound readings pass."""

import numpy as np
import pytest

from s2c2a.measurements.readings import ReadingCheck
from s2c2a.spaces import Reading, Sensor

PERIOD = 0.1
SENSORS = {
    "bends": Sensor((2,), "rad", -1.0, 1.0, fastest=2.0),
    "flex": Sensor((3,), "V"),
    "unused": Sensor((1,), "1", 0.0, 1.0),
}
SOUND = np.array([0.1, -0.2])


class PeriodicCheck:
    """Passes one reading a period to a check."""

    def __init__(self, required=("bends",), sensors=SENSORS):
        self.check = ReadingCheck(sensors, required, PERIOD)
        self.time = 0.0

    def __call__(self, bends=SOUND, last_change=0.0, time=None, now=None, **others):
        self.time += PERIOD
        present = others if bends is None else {"bends": bends, **others}
        time = self.time if time is None else time
        now = self.time if now is None else now
        return self.check.find_fault(Reading(time, present), now, last_change)


@pytest.fixture
def fault():
    return PeriodicCheck()


def test_sound_readings_pass(fault):
    assert not any(fault(SOUND + 0.01 * step, last_change=0.04) for step in range(50))


FAULTS = {
    "missing": (None, "'bends' is missing"),
    "too few": (np.zeros(1), r"'bends' has shape \(1,\), declared as \(2,\)"),
    "deep": (np.zeros((1, 2)), r"has shape \(1, 2\)"),
    "NaN": (np.array([0.0, np.nan]), "'bends' is not finite"),
    "infinite": (np.array([0.0, -np.inf]), "'bends' is not finite"),
    "infinite both ways": (np.array([np.inf, -np.inf]), "'bends' is not finite"),
    "beyond all numbers": (np.array([1.7e308, 1.7e308]), "'bends' is out of its range"),
    "below": (np.array([0.0, -1.1]), "'bends' is out of its range"),
    "above": (np.array([1.1, 0.0]), "'bends' is out of its range"),
    "a million times": (1e6 * SOUND, "'bends' is out of its range"),
    "jumped": (SOUND + np.array([0.0, 0.21]), "'bends' has jumped"),
    "words": (np.array(["a", "b"]), "'bends' is not an array of numbers"),
    "objects": (np.array([None, None]), "'bends' is not an array of numbers"),
    "a list": ([0.1, -0.2], "'bends' is not an array of numbers"),
}


@pytest.mark.parametrize(("bends", "message"), FAULTS.values(), ids=FAULTS)
def test_a_fault_is_described_and_the_next_sound_reading_passes(fault, bends, message):
    assert fault() == ""
    with pytest.raises(AssertionError, match=message):
        assert fault(bends) == ""
    assert fault(SOUND + 1e-6) == ""


@pytest.mark.parametrize(
    ("bends", "message"), [fault for name, fault in FAULTS.items() if name != "jumped"]
)
def test_a_fault_of_the_first_reading_is_described_too(bends, message):
    with pytest.raises(AssertionError, match=message):
        assert PeriodicCheck()(bends) == ""


def test_the_fastest_possible_change_is_no_jump(fault):
    assert [fault(SOUND + change) for change in (0.0, 0.199, 0.0)] == [""] * 3


def test_after_a_gap_a_sensor_may_have_changed_more(fault):
    """0.55 rad in three periods are less than 2 rad/s."""
    fault()
    fault(np.full(2, np.nan))
    fault(np.full(2, np.nan))
    assert fault(SOUND + 0.55) == ""


def test_a_sensor_that_jumped_and_stays_passes_once_it_could_have_moved_there(fault):
    fault()
    faults = [fault(SOUND + 0.5) for _ in range(3)]
    assert faults == ["'bends' has jumped"] * 2 + [""]


def test_a_sensor_that_jumps_to_and_fro_never_passes(fault):
    fault()
    faults = {fault(SOUND + 0.5 * (-1) ** step) for step in range(30)}
    assert faults == {"'bends' has jumped"}
    assert fault(SOUND) == ""


def test_a_sensor_that_repeats_to_the_last_bit_while_the_arm_moves_is_frozen(fault):
    faults = [fault(last_change=0.04) for _ in range(6)]
    assert faults[:3] == [""] * 3
    assert set(faults[3:]) == {"'bends' is frozen"}
    assert fault(SOUND + 1e-12, last_change=0.04) == ""


def test_a_frozen_sensor_stays_frozen_while_the_arm_is_held(fault):
    for _ in range(6):
        fault(last_change=0.04)
    assert {fault(last_change=0.0) for _ in range(20)} == {"'bends' is frozen"}


def test_sensors_of_an_arm_at_rest_may_repeat_for_ever(fault):
    assert {fault(last_change=0.0) for _ in range(1000)} == {""}


def test_sensors_of_an_arm_that_hardly_moves_may_repeat_for_a_while(fault):
    """A coarse encoder need not resolve a thousandth of a bend."""
    assert {fault(last_change=1e-3) for _ in range(18)} == {""}


def test_an_arm_within_its_backlash_may_rest_while_commands_change():
    states = {"states": Sensor((6,), "m")}
    check = PeriodicCheck(("states",), states)
    faults = [check(None, states=np.ones(6), last_change=0.02) for _ in range(20)]
    assert faults[:15] == [""] * 15
    assert faults[-1] == "'states' is frozen"


def test_one_of_two_sensors_can_be_frozen_alone():
    fault = PeriodicCheck(("bends", "flex"))
    for step in range(5):
        last = fault(SOUND + 0.001 * step, last_change=0.04, flex=np.ones(3))
    assert last == "'flex' is frozen"


@pytest.mark.parametrize("time", [np.nan, np.inf, -np.inf])
def test_a_reading_without_a_time_fails(fault, time):
    assert fault(time=time) == "the reading has no time"


@pytest.mark.parametrize("time", [0.1, 0.05, -3.0])
def test_a_reading_no_newer_than_the_last_one_fails(fault, time):
    fault()
    assert fault(time=time) == "the reading is no newer than the last one"


def test_a_reading_may_be_three_periods_behind_and_no_more(fault):
    assert fault(time=1.0, now=1.29) == ""
    assert fault(time=1.1, now=1.45) == "the reading is 0.35 s old"


def test_sensors_that_are_not_required_are_not_checked():
    fault = PeriodicCheck(("bends",))
    values = np.array([np.nan]), np.array([9e9]), np.zeros((4, 4)), "words", np.zeros(1)
    for step, odd in enumerate(values):
        assert fault(SOUND + 0.001 * step, last_change=0.04, unused=odd) == ""
    assert fault(SOUND + 0.1, last_change=0.04) == ""


def test_a_sensor_that_the_robot_does_not_declare_is_missing():
    fault = PeriodicCheck(("other",))
    assert fault(other=np.zeros(2)) == "'other' is missing"


def test_without_required_sensors_only_the_time_counts():
    fault = PeriodicCheck(())
    assert fault(bends=None) == ""
    assert fault(time=0.0) == "the reading is no newer than the last one"


def test_every_element_can_have_its_own_limits():
    limits = np.array([[-1.0, 0.0], [1.0, 5.0], [0.5, 50.0]])
    fault = PeriodicCheck(sensors={"bends": Sensor((2,), "rad", *limits)})
    assert fault(np.array([0.0, 4.0])) == ""
    assert fault(np.array([0.0, 0.5])) == ""
    assert fault(np.array([0.0, -0.1])) == "'bends' is out of its range"
    assert fault(np.array([0.3, 0.5])) == "'bends' has jumped"


def test_a_reset_check_has_no_earlier_reading(fault):
    for _ in range(6):
        fault(last_change=0.04)
    fault.check.reset()
    assert fault(SOUND + 0.9, last_change=0.04, time=0.0, now=0.0) == ""


def test_a_fault_of_one_sensor_makes_no_jump_of_another():
    """The second sensor moves at half its fastest rate all the time."""
    kind = Sensor((2,), "rad", -9.0, 9.0, fastest=2.0)
    sensors = {"bends": kind, "other": kind}
    fault = PeriodicCheck(("bends", "other"), sensors)
    missing = np.full(2, np.nan)
    faults = []
    for step in range(12):
        bends = missing if 3 <= step < 8 else SOUND
        faults.append(fault(bends, other=SOUND + 0.1 * step))
    assert faults == [""] * 3 + ["'bends' is not finite"] * 5 + [""] * 4
    jumped = fault(SOUND, other=SOUND + 9 * 0.5)
    assert jumped == "'other' has jumped"


def test_a_faulty_reading_makes_no_jump_of_a_sensor_that_moves(fault):
    fault()
    for step in range(1, 6):
        stale = fault(SOUND + 0.15 * step, now=fault.time + 9.0)
        assert "s old" in stale
    assert fault(SOUND + 0.15 * 6) == ""


@pytest.mark.parametrize("kind", ["?", "u1", "u8", "i1", "f2"])
def test_numbers_of_any_type_may_fall_as_they_rise(kind):
    sensors = {"raw": Sensor((2,), "V", fastest=200.0)}
    fault = PeriodicCheck(("raw",), sensors)
    rising = np.array([0, 1]).astype(kind)
    for raw in (rising, rising[::-1], rising):
        assert fault(None, raw=raw) == ""


def test_a_jump_of_small_integers_does_not_wrap_around():
    fault = PeriodicCheck(("raw",), {"raw": Sensor((1,), "V", fastest=1000.0)})
    assert fault(None, raw=np.array([-100], np.int8)) == ""
    assert fault(None, raw=np.array([100], np.int8)) == "'raw' has jumped"


def test_a_sensor_may_show_the_same_in_the_steps_of_its_period():
    check = ReadingCheck(SENSORS, ("bends",), PERIOD, steps=5)
    times = np.repeat(PERIOD * np.arange(1, 40), 5)
    for number, time in enumerate(times):
        bends = SOUND + 0.002 * time
        last = Reading(time, {"bends": bends})
        assert check.find_fault(last, time, 0.01) == "", number
    faults = [check.find_fault(last, times[-1], 0.01) for _ in range(5)]
    assert faults[-1] == "the reading is no newer than the last one"
