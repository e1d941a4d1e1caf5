"""Which readings are believed: each fault told in words, and nothing said against a sound arm at rest."""

import numpy as np
import pytest

from s2c2a.runtime.readings import ReadingCheck
from s2c2a.spaces import Reading, Sensor

PERIOD = 0.1
SENSORS = {
    "bends": Sensor((2,), "rad", -1.0, 1.0, fastest=2.0),
    "flex": Sensor((3,), "V"),
    "unused": Sensor((1,), "1", 0.0, 1.0),
}
SOUND = np.array([0.1, -0.2])


class Watch:
    """Feeds a check with a reading a period."""

    def __init__(self, needed=("bends",), sensors=SENSORS):
        self.check, self.time = ReadingCheck(sensors, needed, PERIOD), 0.0

    def __call__(self, bends=SOUND, moved=0.0, time=None, now=None, **others):
        self.time += PERIOD
        said = {
            name: values
            for name, values in ({"bends": bends} | others).items()
            if values is not None
        }
        time = self.time if time is None else time
        return self.check.find_fault(
            Reading(time, said), self.time if now is None else now, moved
        )


@pytest.fixture
def fault():
    return Watch()


def test_sound_readings_are_believed(fault):
    assert [fault(SOUND + 0.01 * step, moved=0.04) for step in range(50)] == [""] * 50


FAULTS = {
    "missing": (None, "'bends' is missing"),
    "too few": (np.zeros(1), r"'bends' has shape \(1,\), expected \(2,\)"),
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


@pytest.mark.parametrize(("bends", "said"), FAULTS.values(), ids=FAULTS)
def test_a_fault_is_told_in_words_and_the_next_sound_reading_is_believed(
    fault, bends, said
):
    assert fault() == ""
    with pytest.raises(AssertionError, match=said):
        assert fault(bends) == ""
    assert fault(SOUND + 1e-6) == ""


@pytest.mark.parametrize(
    ("bends", "said"), [one for name, one in FAULTS.items() if name != "jumped"]
)
def test_a_fault_is_told_in_the_first_reading_too(bends, said):
    with pytest.raises(AssertionError, match=said):
        assert Watch()(bends) == ""


def test_a_change_just_as_fast_as_a_sensor_can_change_is_no_jump(fault):
    assert [fault(SOUND + change) for change in (0.0, 0.199, 0.0)] == [""] * 3


def test_after_a_gap_a_sensor_may_have_gone_further(fault):
    """0.55 rad in three periods is less than 2 rad/s; the bad readings between are not compared with."""
    fault()
    fault(np.full(2, np.nan))
    fault(np.full(2, np.nan))
    assert fault(SOUND + 0.55) == ""


def test_a_sensor_that_jumped_and_stays_there_is_believed_when_it_could_have_come_there(
    fault,
):
    fault()
    assert [fault(SOUND + 0.5) for _ in range(3)] == [
        "'bends' has jumped",
        "'bends' has jumped",
        "",
    ]


def test_a_sensor_that_jumps_to_and_fro_is_not_believed_however_long_it_does(fault):
    fault()
    assert {fault(SOUND + 0.5 * (-1) ** step) for step in range(30)} == {
        "'bends' has jumped"
    }
    assert fault(SOUND) == ""


def test_a_sensor_that_says_the_same_to_the_last_bit_while_the_arm_moves_is_frozen(
    fault,
):
    said = [fault(moved=0.04) for _ in range(6)]
    assert said[:3] == [""] * 3
    assert set(said[3:]) == {"'bends' is frozen"}
    assert fault(SOUND + 1e-12, moved=0.04) == ""


def test_it_stays_frozen_while_the_arm_is_held(fault):
    for _ in range(6):
        fault(moved=0.04)
    assert {fault(moved=0.0) for _ in range(20)} == {"'bends' is frozen"}


def test_an_arm_at_rest_may_say_the_same_for_ever(fault):
    assert {fault(moved=0.0) for _ in range(1000)} == {""}


def test_an_arm_that_hardly_moves_may_say_the_same_for_a_while(fault):
    """A coarse encoder: a thousandth of a bend a step is nothing that it must notice at once."""
    assert {fault(moved=1e-3) for _ in range(18)} == {""}


def test_one_of_two_sensors_can_be_frozen_alone():
    fault = Watch(("bends", "flex"))
    said = [
        fault(SOUND + 0.001 * step, moved=0.04, flex=np.ones(3)) for step in range(5)
    ]
    assert said[-1] == "'flex' is frozen"


@pytest.mark.parametrize("time", [np.nan, np.inf, -np.inf])
def test_a_reading_without_a_time_is_not_believed(fault, time):
    assert fault(time=time) == "the reading has no time"


@pytest.mark.parametrize("time", [0.1, 0.05, -3.0])
def test_a_reading_no_newer_than_the_last_one_is_not_believed(fault, time):
    fault()
    assert fault(time=time) == "the reading is no newer than the last one"


def test_a_reading_may_be_three_periods_behind_and_no_more(fault):
    assert fault(time=1.0, now=1.29) == ""
    assert fault(time=1.1, now=1.45) == "the reading is 0.35 s old"


def test_what_nobody_needs_may_say_anything():
    fault = Watch(("bends",))
    for step, odd in enumerate(
        [
            np.array([np.nan]),
            np.array([9e9]),
            np.zeros((4, 4)),
            "words",
            None,
            np.zeros(1),
        ]
    ):
        assert fault(SOUND + 0.001 * step, moved=0.04, unused=odd) == ""


def test_what_a_body_does_not_declare_is_missing_whatever_it_says():
    fault = Watch(("other",))
    assert fault(other=np.zeros(2)) == "'other' is missing"


def test_with_nothing_needed_only_the_time_counts():
    fault = Watch(())
    assert fault(bends=None) == ""
    assert fault(time=0.0) == "the reading is no newer than the last one"


def test_one_limit_a_number_is_heeded_one_by_one():
    sensors = {
        "bends": Sensor(
            (2,),
            "rad",
            np.array([-1.0, 0.0]),
            np.array([1.0, 5.0]),
            np.array([0.5, 50.0]),
        )
    }
    fault = Watch(("bends",), sensors)
    assert fault(np.array([0.0, 4.0])) == ""
    assert fault(np.array([0.0, 0.5])) == ""
    assert fault(np.array([0.0, -0.1])) == "'bends' is out of its range"
    assert fault(np.array([0.3, 0.5])) == "'bends' has jumped"


def test_opened_anew_a_check_has_seen_nothing(fault):
    for _ in range(6):
        fault(moved=0.04)
    fault.check.reset()
    assert fault(SOUND + 0.9, moved=0.04, time=0.0, now=0.0) == ""
