"""Stages of a controlled arm, as a state machine in pure functions (docs/concepts/safety.md).

```
         enabled          sound        not enabled, or unsound
   IDLE ---------> START ------> RUN <-------------------------> HOLD
    ^                |                  enabled and sound          |
    |                | unsound for                    unsound, or without operator,
    |                v too long                                    v for too long
    |              FAULT <------------ was unsound ------------ RELEASE
    +--------------------------------- otherwise ------------------+
```
An error of the robot or of the controller leads to FAULT from any stage. A reading is
sound if it passes `ReadingCheck`.
"""

from dataclasses import dataclass, replace

from s2c2a.errors import S2C2AError
from s2c2a.files.text import LARGEST
from s2c2a.goals import Goal
from s2c2a.runtime.clock import STANDSTILL
from s2c2a.spaces import Stage

RECOVERY_PER_SOUND_STEP = 0.5
"""Unsound steps that one sound step offsets: a sensor that fails every other step
still uses up the patience."""


@dataclass(frozen=True)
class Patience:
    """How long the loop waits before it moves the arm to rest, or asks.

    Attributes:
        unsound: steps without a sound reading.
        alone: steps held without an operator.
        standstill: time beyond a control period without a command [s], after which a
            real arm is held until `Loop.resume`.
    """

    unsound: int
    alone: int
    standstill: float = STANDSTILL

    @classmethod
    def of(
        cls,
        control_rate: float,
        unsound: float = 1.0,
        alone: float = 10.0,
        standstill: float = STANDSTILL,
    ) -> "Patience":
        """Convert times of patience [s] to control steps at a rate [Hz].

        Raises:
            S2C2AError: a time is not positive and finite.
        """
        times = (unsound, alone, standstill)
        if not all(0 < time < LARGEST for time in times):
            shown = ", ".join(f"{time} s" for time in times)
            raise S2C2AError(
                f"patience of {shown}; all must be positive and below {LARGEST:g} s"
            )
        unsound_steps = max(1, round(unsound * control_rate))
        return cls(unsound_steps, max(1, round(alone * control_rate)), standstill)


@dataclass(frozen=True)
class StepRequest:
    """Request for one control step.

    Attributes:
        goal: goal for the state after the step; None keeps the arm where it is.
        enabled: whether the arm shall pursue the goal; if not, it holds or stays at
            rest.
        operator_present: whether an operator attends.
    """

    goal: Goal | None = None
    enabled: bool = True
    operator_present: bool = True

    def __post_init__(self):
        """Copy the goal, whose arrays the caller may use again."""
        if self.goal is not None:
            object.__setattr__(self, "goal", Goal.checked(self.goal).frozen())


@dataclass(frozen=True)
class Phase:
    """Stage of an arm, with the counters that decide on the next one.

    Attributes:
        stage: what the arm does.
        unsound_steps: steps without a sound reading, less those that sound ones
            offset.
        unattended_steps: consecutive steps held without an operator.
        ends_in_fault: whether readings caused the release, so that it ends in FAULT.
    """

    stage: Stage = Stage.IDLE
    unsound_steps: float = 0.0
    unattended_steps: int = 0
    ends_in_fault: bool = False


def next_phase(
    phase: Phase, request: StepRequest, sound: bool, at_rest: bool, patience: Patience
) -> Phase:
    """Return the phase of this step.

    Args:
        phase: phase of the last step.
        request: request for this step.
        sound: whether the reading of this step is sound.
        at_rest: whether the last command was the neutral one.
        patience: steps after which the arm is moved to rest.
    """
    if sound:
        unsound_steps = max(phase.unsound_steps - RECOVERY_PER_SOUND_STEP, 0.0)
    else:
        unsound_steps = min(phase.unsound_steps, patience.unsound) + 1.0
    unattended = phase.stage is Stage.HOLD and not request.operator_present
    unattended_steps = phase.unattended_steps + 1 if unattended else 0
    blind = unsound_steps > patience.unsound
    stage = phase.stage
    if stage in (Stage.IDLE, Stage.START):
        if not request.enabled:
            stage = Stage.IDLE
        elif sound:
            stage = Stage.RUN
        else:
            stage = Stage.FAULT if blind else Stage.START
    elif stage is Stage.RELEASE:
        if at_rest:
            stage = Stage.FAULT if phase.ends_in_fault else Stage.IDLE
    elif stage is not Stage.FAULT:
        if blind or unattended_steps > patience.alone:
            stage = Stage.RELEASE
        else:
            stage = Stage.RUN if request.enabled and sound else Stage.HOLD
    if stage is Stage.IDLE:
        unsound_steps = 0.0
    stopping = stage in (Stage.RELEASE, Stage.FAULT)
    ends_in_fault = stopping and (phase.ends_in_fault or blind)
    return Phase(stage, unsound_steps, unattended_steps, ends_in_fault)


def with_release(phase: Phase) -> Phase:
    """Return the phase of an arm that moves to rest; one that is stopped stays so."""
    if phase.stage in (Stage.FAULT, Stage.IDLE):
        return phase
    return replace(phase, stage=Stage.RELEASE)
