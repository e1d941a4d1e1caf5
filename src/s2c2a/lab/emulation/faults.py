"""Faults of emulated servos: on the line, in a servo, in the arm."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from s2c2a.lab.emulation.fault_texts import (
    MAYBE_SECONDS,
    SECONDS,
    SHARE,
    Argument,
    Fault,
    FaultGrammar,
    FaultShares,
)
from s2c2a.lab.emulation.instructions import Reply

if TYPE_CHECKING:
    from s2c2a.lab.emulation.emulator import Emulator

STUFFED_POSITION = -131_073  # ticks; FF FF FD FF on the wire
_LONGEST_GARBAGE = 8  # bytes
_HEAD = 9  # bytes of an answer before its data, which two servos with one id share
_SHORTEST_MEASUREMENT = 20  # bytes of an answer with measurements


_ID = Argument("ID", high=None)
KINDS: dict[str, tuple[Argument, ...]] = {
    "lost": (SHARE,),
    "corrupted": (SHARE,),
    "late": (SECONDS, SHARE),
    "garbage": (SHARE,),
    "stuffed": (_ID,),
    "gone": (_ID, MAYBE_SECONDS),
    "reboot": (_ID,),
    "hot": (_ID,),
    "overload": (_ID,),
    "stalled": (_ID,),
    "snapped": (_ID,),
    "voltage": (Argument("VOLTS", 0, 60),),
    "unplug": (SECONDS, _ID._replace(required=False)),
    "model": (_ID, Argument("NUMBER", 0, 65_535)),
    "twin": (_ID, Argument("DOUBLED", 0, 1, required=False)),
}
"""Kinds of faults and their arguments.

lost, corrupted, late, garbage: share of the answers that are lost, have a flipped bit,
come later, follow random bytes; from then on, until the kind comes again with share 0.
stuffed: the servo calls its position `STUFFED_POSITION`, which needs byte stuffing.
gone: off the bus, for good or for a time, with its torque unchanged. reboot: restarts,
as after a drop of the supply. hot: heats up until it shuts down. overload: shuts down.
stalled: the motor is jammed. snapped: the cable is torn. voltage: of the supply.
unplug: the port of a servo disappears for a time, by default all ports. model: the servo
states another model number.
twin: another servo has the same id; both answer at once, so that measurements damage
each other, or, with DOUBLED 1, one after the other.
"""
LINE_KINDS = frozenset(("lost", "corrupted", "late", "garbage"))


GRAMMAR = FaultGrammar("a fault", "servo", KINDS, "3 gone 4 1.5", has_torque=True)


class FaultSchedule:
    """Faults of one emulator that are still to come."""

    def __init__(self, faults: Sequence[Fault]):
        """Begin with all faults."""
        self._pending = list(faults)
        self._torque_time: float | None = None

    def apply_until(self, emulator: "Emulator") -> None:
        """Apply all faults that are due."""
        if not self._pending:
            return
        if self._torque_time is None and any(one.torque for one in emulator.servos):
            self._torque_time = emulator.now
        due = [fault for fault in self._pending if self._is_due(fault, emulator.now)]
        self._pending = [fault for fault in self._pending if fault not in due]
        for fault in due:
            apply_fault(fault, emulator)

    def _is_due(self, fault: Fault, now: float) -> bool:
        if not fault.after_torque:
            return fault.time <= now
        return self._torque_time is not None and self._torque_time + fault.time <= now


def apply_fault(fault: Fault, emulator: "Emulator") -> None:
    """Let a fault occur now."""
    if fault.kind in LINE_KINDS:
        emulator.disturbances.values[fault.kind] = fault.values
    elif fault.kind == "voltage":
        emulator.voltage = fault.values[0]
    elif fault.kind == "unplug":
        emulator.unplug(fault.values[0], *map(int, fault.targets))
    else:
        winch = next(
            one for one in emulator.winches if one.original_id == int(fault.targets[0])
        )
        servo = winch.servo
        match fault.kind:
            case "stuffed":
                servo.shift_position(STUFFED_POSITION)
            case "gone":
                seconds = fault.values[0] if fault.values else float("inf")
                servo.gone_until = emulator.now + seconds
            case "reboot":
                servo.restart(emulator.now)
            case "hot":
                servo.overheats = True
            case "overload":
                servo.raise_error("overload")
            case "stalled":
                emulator.plant.stalled[winch.cable] = True
            case "snapped":
                emulator.plant.snapped[winch.cable] = True
            case "model":
                servo["model_number"] = int(fault.values[0])
            case "twin":
                is_doubled = any(fault.values)
                emulator.disturbances.twins[servo.id] = is_doubled


class LineFaults(FaultShares):
    """What happens to answers on the line.

    Attributes:
        twins: ids that two servos have; whether their answers follow each other.
    """

    def __init__(self, random: np.random.Generator):
        """Begin without disturbances.

        Args:
            random: decides which answers are hit.
        """
        super().__init__(random)
        self.twins: dict[int, bool] = {}

    def disturb(self, answers: list[Reply]) -> list[Reply]:
        """Return answers as they leave the line; a lost one is empty."""
        if self.twins:
            answers = [self._answer_twice(answer) for answer in answers]
        if not self.values:
            return answers
        return [self._disturb(answer) for answer in answers]

    def _answer_twice(self, answer: Reply) -> Reply:
        """The answers of two servos; the line is low where one of them pulls it low."""
        is_doubled = self.twins.get(answer.id)
        if is_doubled is None:
            return answer
        if is_doubled:
            return replace(answer, data=2 * answer.data)
        if len(answer.data) < _SHORTEST_MEASUREMENT:  # both say the same
            return answer
        other = self._random.bytes(len(answer.data) - _HEAD)
        tail = bytes(map(int.__and__, answer.data[_HEAD:], other))
        return replace(answer, data=answer.data[:_HEAD] + tail)

    def _disturb(self, answer: Reply) -> Reply:
        if self.hits("late"):
            delay = answer.delay + self.values["late"][0]
            answer = replace(answer, delay=delay)
        if self.hits("corrupted"):
            answer = replace(answer, data=self._flip_bit(answer.data))
        if self.hits("garbage"):
            size = self._random.integers(1, _LONGEST_GARBAGE + 1)
            answer = replace(answer, data=self._random.bytes(int(size)) + answer.data)
        if self.hits("lost"):
            answer = replace(answer, data=b"")
        return answer

    def _flip_bit(self, data: bytes) -> bytes:
        flipped = bytearray(data)
        place = self._random.integers(len(flipped))
        flipped[place] ^= 1 << int(self._random.integers(8))
        return bytes(flipped)
