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
from s2c2a.spaces import Stage


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
    def of(cls, control_rate: float, unsound: float = 1.0, alone: float = 10.0) -> "Patience":
        """The same in seconds.

        Raises:
            S2C2AError: a time is not positive and finite.
        """
        if not (0 < unsound < 1e6 and 0 < alone < 1e6):
            raise S2C2AError(f"{unsound} s and {alone} s of patience asked for; both must be positive")
        return cls(max(1, round(unsound * control_rate)), max(1, round(alone * control_rate)))


@dataclass(frozen=True)
class Situation:
    """What decides on the next stage.

    Attributes:
        asked: whether the arm shall do something, by somebody who is there or a task.
        attended: whether somebody is there, so that an arm may be held as long as they like.
        sound: whether the reading of this step is sound.
        at_rest: whether the last command was the neutral one.
    """

    asked: bool
    attended: bool = True
    sound: bool = True
    at_rest: bool = False


@dataclass(frozen=True)
class Phase:
    """A stage, and what it remembers.

    Attributes:
        stage: what the arm does.
        unsound: steps in a row without a sound reading.
        alone: steps in a row that it was held while nobody attended.
        spoiled: whether a release is for unsound readings, and ends in FAULT.
    """

    stage: Stage = Stage.IDLE
    unsound: int = 0
    alone: int = 0
    spoiled: bool = False


def next_phase(phase: Phase, now: Situation, patience: Patience) -> Phase:
    """The phase of this step, from that of the last one."""
    unsound = 0 if now.sound else phase.unsound + 1
    alone = phase.alone + 1 if phase.stage is Stage.HOLD and not now.attended else 0
    phase = replace(phase, unsound=unsound, alone=alone)
    stage = _next_stage(phase, now, patience)
    spoiled = stage in (Stage.RELEASE, Stage.FAULT) and (phase.spoiled or unsound > patience.unsound)
    return replace(phase, stage=stage, spoiled=spoiled)


def _next_stage(phase: Phase, now: Situation, patience: Patience) -> Stage:
    impatient = phase.unsound > patience.unsound
    if phase.stage is Stage.FAULT:
        return Stage.FAULT
    if phase.stage is Stage.RELEASE:
        return Stage.RELEASE if not now.at_rest else Stage.FAULT if phase.spoiled else Stage.IDLE
    if phase.stage in (Stage.IDLE, Stage.START):
        if not now.asked:
            return Stage.IDLE
        return Stage.RUN if now.sound else Stage.FAULT if impatient else Stage.START
    if impatient or phase.alone > patience.alone:
        return Stage.RELEASE
    return Stage.RUN if now.asked and now.sound else Stage.HOLD


def failed(phase: Phase) -> Phase:
    """After a fault of the body, or of what drives it."""
    return replace(phase, stage=Stage.FAULT)


def released(phase: Phase) -> Phase:
    """When somebody wants the arm led to rest; one that stands still by a fault stays so."""
    return phase if phase.stage in (Stage.FAULT, Stage.IDLE) else replace(phase, stage=Stage.RELEASE)
