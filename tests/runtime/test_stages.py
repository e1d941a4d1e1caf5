"""Stages of a controlled arm: every transition, and invariants of all sequences."""

from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.errors import S2C2AError
from s2c2a.runtime.stages import Patience, Phase, StepRequest, next_phase, with_release
from s2c2a.spaces import Stage

IDLE, START, RUN, HOLD, RELEASE, FAULT = Stage
PATIENCE = Patience(unsound=3, alone=5)


class Situation(NamedTuple):
    """Inputs that decide on the next stage."""

    enabled: bool
    operator_present: bool = True
    sound: bool = True
    at_rest: bool = False


ENABLED = Situation(enabled=True)
DISABLED = Situation(enabled=False)
UNSOUND = Situation(enabled=True, sound=False)
UNATTENDED = Situation(enabled=False, operator_present=False)
DISABLED_UNSOUND = Situation(enabled=False, sound=False)
AT_REST = Situation(enabled=True, at_rest=True)
LONG_UNSOUND = {"unsound_steps": 3}
LONG_UNATTENDED = {"unattended_steps": 5}

TRANSITIONS = [
    ("not enabled", IDLE, {}, DISABLED, IDLE),
    ("not enabled and unsound", IDLE, {"unsound_steps": 9}, DISABLED_UNSOUND, IDLE),
    ("enabled and sound", IDLE, {}, ENABLED, RUN),
    ("enabled, not sound yet", IDLE, {}, UNSOUND, START),
    ("enabled, unsound for too long", IDLE, LONG_UNSOUND, UNSOUND, FAULT),
    ("sound now", START, {"unsound_steps": 2}, ENABLED, RUN),
    ("not sound yet", START, {"unsound_steps": 2}, UNSOUND, START),
    ("unsound for too long", START, LONG_UNSOUND, UNSOUND, FAULT),
    ("disabled", START, {"unsound_steps": 2}, DISABLED_UNSOUND, IDLE),
    ("enabled and sound", RUN, {}, ENABLED, RUN),
    ("disabled", RUN, {}, DISABLED, HOLD),
    ("one unsound reading", RUN, {}, UNSOUND, HOLD),
    ("no operator", RUN, {}, UNATTENDED, HOLD),
    ("enabled again", HOLD, {}, ENABLED, RUN),
    ("sound again", HOLD, LONG_UNSOUND, ENABLED, RUN),
    (
        "operator holds the arm without a time limit",
        HOLD,
        {"unattended_steps": 99},
        DISABLED,
        HOLD,
    ),
    ("no operator for a while", HOLD, {"unattended_steps": 4}, UNATTENDED, HOLD),
    ("no operator for too long", HOLD, LONG_UNATTENDED, UNATTENDED, RELEASE),
    ("unsound for a while", HOLD, {"unsound_steps": 2}, UNSOUND, HOLD),
    ("unsound for too long", HOLD, LONG_UNSOUND, UNSOUND, RELEASE),
    ("moving to rest, enabled", RELEASE, {}, ENABLED, RELEASE),
    ("moving to rest, unsound", RELEASE, {}, UNSOUND, RELEASE),
    ("at rest", RELEASE, {}, AT_REST, IDLE),
    (
        "at rest after unsound readings",
        RELEASE,
        {"ends_in_fault": True},
        AT_REST,
        FAULT,
    ),
    ("enabled in a fault", FAULT, {}, ENABLED, FAULT),
    ("not enabled in a fault", FAULT, {}, DISABLED, FAULT),
    ("at rest in a fault", FAULT, {"ends_in_fault": True}, AT_REST, FAULT),
]


def after(phase, now):
    """Phase that follows in a situation."""
    return next_phase(
        phase,
        StepRequest(None, now.enabled, now.operator_present),
        now.sound,
        now.at_rest,
        PATIENCE,
    )


@pytest.mark.parametrize(
    ("stage", "counters", "situation", "expected"),
    [transition[1:] for transition in TRANSITIONS],
    ids=[f"{stage.name}-{reason}" for reason, stage, *_ in TRANSITIONS],
)
def test_every_transition_leads_to_its_stage(stage, counters, situation, expected):
    assert after(Phase(stage, **counters), situation).stage is expected


def test_an_arm_can_be_released_unless_it_is_at_rest_or_in_a_fault():
    expected = {
        IDLE: IDLE,
        START: RELEASE,
        RUN: RELEASE,
        HOLD: RELEASE,
        RELEASE: RELEASE,
        FAULT: FAULT,
    }
    assert {stage: with_release(Phase(stage)).stage for stage in Stage} == expected


def follow(situations, phase=None):
    """Phases of successive situations."""
    phases = [phase or Phase()]
    for situation in situations:
        phases.append(after(phases[-1], situation))
    return phases[1:]


def test_a_fault_that_ends_in_time_is_forgotten():
    """Three unsound steps and six sound ones, repeatedly: the arm never gives up."""
    stages = {
        phase.stage
        for phase in follow([ENABLED, *[*[UNSOUND] * 3, *[ENABLED] * 6] * 9])
    }
    assert stages == {RUN, HOLD}


def test_a_fault_in_every_other_step_is_not_forgotten():
    stages = [phase.stage for phase in follow([ENABLED, *[UNSOUND, ENABLED] * 9])]
    assert stages[:4] == [RUN, HOLD, RUN, HOLD]
    assert stages[-1] is RELEASE


def test_unsound_readings_at_rest_are_forgotten():
    stages = [
        phase.stage
        for phase in follow(
            [*[DISABLED_UNSOUND] * 60, ENABLED, ENABLED, UNSOUND, ENABLED]
        )
    ]
    assert stages[60:] == [RUN, RUN, HOLD, RUN]


def test_a_release_with_unsound_readings_ends_in_a_fault():
    situations = [*[UNSOUND] * 4, Situation(enabled=False, at_rest=True)]
    assert follow(situations, Phase(RELEASE))[-1].stage is FAULT


SITUATIONS = st.lists(
    st.builds(Situation, st.booleans(), st.booleans(), st.booleans(), st.booleans()),
    max_size=60,
)
PHASES = st.builds(
    Phase, st.sampled_from(Stage), st.integers(0, 9), st.integers(0, 9), st.booleans()
)


@given(SITUATIONS, PHASES)
def test_an_arm_never_runs_on_an_unsound_reading_or_without_being_enabled(
    situations, phase
):
    for situation, now in zip(situations, follow(situations, phase), strict=True):
        assert now.stage is not RUN or (situation.sound and situation.enabled)


@given(SITUATIONS)
def test_a_fault_never_ends_by_itself(situations):
    assert {phase.stage for phase in follow(situations, Phase(FAULT))} <= {FAULT}


@given(SITUATIONS, st.booleans())
def test_a_release_goes_on_until_the_arm_is_at_rest_and_ends_there(situations, spoiled):
    for situation, now in zip(
        situations,
        follow(situations, Phase(RELEASE, ends_in_fault=spoiled)),
        strict=True,
    ):
        if situation.at_rest:
            assert now.stage in (IDLE, FAULT)
            break
        assert now.stage is RELEASE


@given(SITUATIONS)
def test_an_arm_at_rest_runs_before_it_holds_or_is_released(situations):
    """RUN follows IDLE, START, or HOLD; HOLD and RELEASE follow RUN."""
    before = IDLE
    predecessors = {
        RUN: {IDLE, START, RUN, HOLD},
        HOLD: {RUN, HOLD},
        RELEASE: {RUN, HOLD, RELEASE},
    }
    for now in follow(situations):
        assert before in predecessors.get(now.stage, set(Stage))
        before = now.stage


def test_patience_is_counted_in_control_steps():
    assert Patience.of(10.0, unsound=1.0, alone=10.0) == Patience(10, 100)
    assert Patience.of(0.5, unsound=0.1, alone=0.1) == Patience(1, 1)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_patience_must_be_positive_and_finite(seconds):
    with pytest.raises(S2C2AError, match="must be positive"):
        Patience.of(10.0, unsound=seconds)
    with pytest.raises(S2C2AError, match="must be positive"):
        Patience.of(10.0, alone=seconds)
