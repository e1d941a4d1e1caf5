"""The stages of an arm that is driven, as a pure function (docs/safety.md has the table).

```
          asked            sound              not asked, or not sound
   IDLE --------> START ---------> RUN <-----------------------------> HOLD
    ^               |                          asked and sound          |
    |               | not sound for too long                            | unsound, or left alone, for too long
    |               v                                                   v
    |             FAULT <----------------- was unsound ------------- RELEASE
    +---------------------------------------- else ---------------------+
```
A fault of the body or of what drives it leads to FAULT from anywhere.
"""

from dataclasses import dataclass, replace

from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.spaces import Stage

MADE_GOOD = 0.5
"""Unsound steps that a sound one makes good for: a sensor that fails every other time
is not waited for without end."""


@dataclass(frozen=True)
class Patience:
    """How many control steps are waited for what.

    Attributes:
        unsound: without a sound reading, then the arm is led to rest.
        alone: held while nobody attends, then the arm is led to rest.
    """

    unsound: int
    alone: int

    @classmethod
    def of(
        cls, control_rate: float, unsound: float = 1.0, alone: float = 10.0
    ) -> "Patience":
        """The same in seconds.

        Raises:
            S2C2AError: a time is not positive and finite.
        """
        if not (0 < unsound < 1e6 and 0 < alone < 1e6):
            raise S2C2AError(
                f"{unsound} s and {alone} s of patience asked for; both must be positive"
            )
        return cls(
            max(1, round(unsound * control_rate)), max(1, round(alone * control_rate))
        )


@dataclass(frozen=True)
class Ask:
    """What is asked of a control step.

    Attributes:
        goal: for the state after it; nothing but little change if None.
        asked: whether the arm shall do it; if not, it holds, or stays at rest.
        attended: whether somebody is there.
    """

    goal: Goal | None = None
    asked: bool = True
    attended: bool = True


@dataclass(frozen=True)
class Phase:
    """A stage, and what it remembers.

    Attributes:
        stage: what the arm does.
        unsound: steps without a sound reading, of which sound ones make good for a
            part.
        alone: steps in a row that it was held while nobody attended.
        spoiled: whether a release is for unsound readings, and ends in FAULT.
    """

    stage: Stage = Stage.IDLE
    unsound: float = 0.0
    alone: int = 0
    spoiled: bool = False


def next_phase(
    phase: Phase, ask: Ask, sound: bool, at_rest: bool, patience: Patience
) -> Phase:
    """The phase of this step.

    Args:
        phase: of the last one.
        ask: what is asked.
        sound: whether the reading of this step is sound.
        at_rest: whether the last command was the neutral one.
        patience: before the arm is led to rest.
    """
    unsound = (
        max(phase.unsound - MADE_GOOD, 0.0)
        if sound
        else min(phase.unsound, patience.unsound) + 1.0
    )
    alone = phase.alone + 1 if phase.stage is Stage.HOLD and not ask.attended else 0
    impatient = unsound > patience.unsound
    give_up = impatient or alone > patience.alone
    stage = _next_stage(phase, ask.asked and sound, give_up, at_rest)
    if phase.stage in (Stage.IDLE, Stage.START):
        stage = _first_stage(ask.asked, sound, impatient)
    spoiled = stage in (Stage.RELEASE, Stage.FAULT) and (phase.spoiled or impatient)
    return Phase(stage, 0.0 if stage is Stage.IDLE else unsound, alone, spoiled)


def _first_stage(asked: bool, sound: bool, impatient: bool) -> Stage:
    """Of an arm that has not run yet."""
    if not asked:
        return Stage.IDLE
    return Stage.RUN if sound else Stage.FAULT if impatient else Stage.START


def _next_stage(phase: Phase, goes_on: bool, give_up: bool, at_rest: bool) -> Stage:
    """Of one that has."""
    if phase.stage is Stage.FAULT or (phase.stage is Stage.RELEASE and not at_rest):
        return phase.stage
    if phase.stage is Stage.RELEASE:
        return Stage.FAULT if phase.spoiled else Stage.IDLE
    return Stage.RELEASE if give_up else Stage.RUN if goes_on else Stage.HOLD


def failed(phase: Phase) -> Phase:
    """After a fault of the body, or of what drives it."""
    return replace(phase, stage=Stage.FAULT)


def released(phase: Phase) -> Phase:
    """When somebody wants the arm led to rest; one that stands still by a fault stays so."""
    return (
        phase
        if phase.stage in (Stage.FAULT, Stage.IDLE)
        else replace(phase, stage=Stage.RELEASE)
    )
