"""The stages of an arm that is driven: every arrow of the picture, and what holds on every way through it."""

from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.errors import S2C2AError
from s2c2a.runtime.stages import Ask, Patience, Phase, failed, next_phase, released
from s2c2a.spaces import Stage

IDLE, START, RUN, HOLD, RELEASE, FAULT = Stage
PATIENCE = Patience(unsound=3, alone=5)


class Situation(NamedTuple):
    """What decides on the next stage."""

    asked: bool
    attended: bool = True
    sound: bool = True
    at_rest: bool = False


ASKED, NOT_ASKED = Situation(asked=True), Situation(asked=False)
UNSOUND, LEFT = (
    Situation(asked=True, sound=False),
    Situation(asked=False, attended=False),
)
UNSOUND_NOT_ASKED, AT_REST = (
    Situation(asked=False, sound=False),
    Situation(asked=True, at_rest=True),
)
LONG_UNSOUND, LONG_ALONE = {"unsound": 3}, {"alone": 5}

ARROWS = [
    ("nothing is asked", IDLE, {}, NOT_ASKED, IDLE),
    (
        "nothing is asked of an arm that cannot sense",
        IDLE,
        {"unsound": 9},
        UNSOUND_NOT_ASKED,
        IDLE,
    ),
    ("asked, and its readings are sound", IDLE, {}, ASKED, RUN),
    ("asked, and its readings are not sound yet", IDLE, {}, UNSOUND, START),
    (
        "asked of an arm that has not sensed for too long",
        IDLE,
        LONG_UNSOUND,
        UNSOUND,
        FAULT,
    ),
    ("its readings are sound now", START, {"unsound": 2}, ASKED, RUN),
    ("its readings are not sound yet", START, {"unsound": 2}, UNSOUND, START),
    ("its readings are not sound for too long", START, LONG_UNSOUND, UNSOUND, FAULT),
    ("nothing is asked any more", START, {"unsound": 2}, UNSOUND_NOT_ASKED, IDLE),
    ("asked and sound", RUN, {}, ASKED, RUN),
    ("not asked any more", RUN, {}, NOT_ASKED, HOLD),
    ("one reading is not sound", RUN, {}, UNSOUND, HOLD),
    ("left alone", RUN, {}, LEFT, HOLD),
    ("asked again", HOLD, {}, ASKED, RUN),
    ("sound again", HOLD, LONG_UNSOUND, ASKED, RUN),
    (
        "somebody lets it hold for as long as they like",
        HOLD,
        {"alone": 99},
        NOT_ASKED,
        HOLD,
    ),
    ("left alone for a while", HOLD, {"alone": 4}, LEFT, HOLD),
    ("left alone for too long", HOLD, LONG_ALONE, LEFT, RELEASE),
    ("not sound for a while", HOLD, {"unsound": 2}, UNSOUND, HOLD),
    ("not sound for too long", HOLD, LONG_UNSOUND, UNSOUND, RELEASE),
    ("on its way to rest, whatever is asked", RELEASE, {}, ASKED, RELEASE),
    ("on its way to rest, whatever is sensed", RELEASE, {}, UNSOUND, RELEASE),
    ("at rest", RELEASE, {}, AT_REST, IDLE),
    ("at rest, and it was not sound", RELEASE, {"spoiled": True}, AT_REST, FAULT),
    ("whatever is asked of one that stands still", FAULT, {}, ASKED, FAULT),
    ("nothing asked of one that stands still", FAULT, {}, NOT_ASKED, FAULT),
    ("at rest and standing still", FAULT, {"spoiled": True}, AT_REST, FAULT),
]


def after(phase, now):
    """The phase that a situation leads to."""
    return next_phase(
        phase, Ask(None, now.asked, now.attended), now.sound, now.at_rest, PATIENCE
    )


@pytest.mark.parametrize(
    ("stage", "memory", "now", "then"),
    [arrow[1:] for arrow in ARROWS],
    ids=[f"{one[1].name}-{one[0]}" for one in ARROWS],
)
def test_every_arrow_of_the_picture_leads_where_it_says(stage, memory, now, then):
    assert after(Phase(stage, **memory), now).stage is then


def test_a_fault_of_the_body_leads_to_a_fault_from_anywhere():
    assert {failed(Phase(stage)).stage for stage in Stage} == {FAULT}


def test_somebody_can_have_the_arm_led_to_rest_but_for_one_that_is_there_or_stands_still():
    expected = {
        IDLE: IDLE,
        START: RELEASE,
        RUN: RELEASE,
        HOLD: RELEASE,
        RELEASE: RELEASE,
        FAULT: FAULT,
    }
    assert {stage: released(Phase(stage)).stage for stage in Stage} == expected


def walked(situations, phase=None):
    """All phases on a way through some situations."""
    phases = [phase or Phase()]
    for situation in situations:
        phases.append(after(phases[-1], situation))
    return phases[1:]


def test_unsound_readings_end_in_a_hold_then_a_release_then_a_fault():
    told = [
        phase.stage
        for phase in walked(
            [ASKED, *[UNSOUND] * 6, Situation(True, sound=False, at_rest=True), ASKED]
        )
    ]
    assert told == [RUN, HOLD, HOLD, HOLD, RELEASE, RELEASE, RELEASE, FAULT, FAULT]


def test_being_left_alone_ends_in_a_hold_then_a_release_then_rest():
    told = [
        phase.stage
        for phase in walked(
            [ASKED, *[LEFT] * 7, Situation(False, attended=False, at_rest=True), ASKED]
        )
    ]
    assert told == [RUN, *[HOLD] * 6, RELEASE, IDLE, RUN]


def test_a_fault_that_ends_in_time_is_forgotten():
    """Three unsound steps and six sound ones, again and again: the arm never gives up."""
    stages = {
        phase.stage for phase in walked([ASKED, *[*[UNSOUND] * 3, *[ASKED] * 6] * 9])
    }
    assert stages == {RUN, HOLD}


def test_a_fault_that_comes_again_and_again_is_not():
    """Every other reading is unsound."""
    stages = [phase.stage for phase in walked([ASKED, *[UNSOUND, ASKED] * 9])]
    assert stages[:4] == [RUN, HOLD, RUN, HOLD]
    assert stages[-1] is RELEASE


def test_what_a_sensor_did_while_the_arm_was_at_rest_is_forgotten():
    stages = [
        phase.stage
        for phase in walked([*[UNSOUND_NOT_ASKED] * 60, ASKED, ASKED, UNSOUND, ASKED])
    ]
    assert stages[60:] == [RUN, RUN, HOLD, RUN]


def test_a_release_that_turns_unsound_on_its_way_ends_in_a_fault():
    way = [*[UNSOUND] * 4, Situation(asked=False, at_rest=True)]
    assert walked(way, Phase(RELEASE))[-1].stage is FAULT


SITUATIONS = st.lists(
    st.builds(Situation, st.booleans(), st.booleans(), st.booleans(), st.booleans()),
    max_size=60,
)
PHASES = st.builds(
    Phase, st.sampled_from(Stage), st.integers(0, 9), st.integers(0, 9), st.booleans()
)


@given(SITUATIONS, PHASES)
def test_on_no_way_does_an_arm_run_on_a_reading_that_is_not_sound_or_without_being_asked(
    situations, phase
):
    for situation, now in zip(situations, walked(situations, phase), strict=True):
        assert now.stage is not RUN or (situation.sound and situation.asked)


@given(SITUATIONS)
def test_on_no_way_does_a_fault_end_by_itself(situations):
    assert {phase.stage for phase in walked(situations, Phase(FAULT))} <= {FAULT}


@given(SITUATIONS, st.booleans())
def test_a_release_goes_on_until_the_arm_is_at_rest_and_ends_there(situations, spoiled):
    for situation, now in zip(
        situations, walked(situations, Phase(RELEASE, spoiled=spoiled)), strict=True
    ):
        if situation.at_rest:
            assert now.stage in (IDLE, FAULT)
            break
        assert now.stage is RELEASE


@given(SITUATIONS)
def test_from_rest_an_arm_only_moves_by_running_first(situations):
    """RUN comes from rest, from starting, or from a hold; a hold and a release come after it."""
    before = IDLE
    came_from = {
        RUN: {IDLE, START, RUN, HOLD},
        HOLD: {RUN, HOLD},
        RELEASE: {RUN, HOLD, RELEASE},
    }
    for now in walked(situations):
        assert before in came_from.get(now.stage, set(Stage))
        before = now.stage


def test_patience_is_counted_in_control_steps():
    assert Patience.of(10.0, unsound=1.0, alone=10.0) == Patience(10, 100)
    assert Patience.of(0.5, unsound=0.1, alone=0.1) == Patience(1, 1)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_patience_that_is_no_time_is_refused(seconds):
    with pytest.raises(S2C2AError, match="must be positive"):
        Patience.of(10.0, unsound=seconds)
    with pytest.raises(S2C2AError, match="must be positive"):
        Patience.of(10.0, alone=seconds)
