"""Faults of emulated servos: on the line, in a servo, in the arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.lab.emulation.answers import Answer

if TYPE_CHECKING:
    from s2c2a.lab.emulation.emulator import Emulator

EXAMPLE = "3 gone 4 1.5"
AFTER_TORQUE = "torque+"
"""Before a time: it counts from the moment at which the first torque is switched on."""

STUFFED_POSITION = -131_073  # ticks; FF FF FD FF on the wire
_LONGEST_GARBAGE = 8  # bytes
_HEAD = 9  # bytes of an answer before its data, which two servos with one id share
_SHORTEST_MEASUREMENT = 20  # bytes of an answer with measurements


class _Argument(NamedTuple):
    """One argument of a fault.

    Attributes:
        name: as users read it.
        low: smallest value.
        high: largest value.
        required: whether it must be given.
    """

    name: str
    low: float = 0.0
    high: float = float("inf")
    required: bool = True


_ID = _Argument("ID")
_SHARE = _Argument("SHARE", 0, 1)
_SECONDS = _Argument("SECONDS")
KINDS: dict[str, tuple[_Argument, ...]] = {
    "lost": (_SHARE,),
    "corrupted": (_SHARE,),
    "late": (_SECONDS, _SHARE),
    "garbage": (_SHARE,),
    "stuffed": (_ID,),
    "gone": (_ID, _SECONDS._replace(required=False)),
    "reboot": (_ID,),
    "hot": (_ID,),
    "overload": (_ID,),
    "stalled": (_ID,),
    "snapped": (_ID,),
    "voltage": (_Argument("VOLTS", 0, 60),),
    "unplug": (_SECONDS,),
    "model": (_ID, _Argument("NUMBER", 0, 65_535)),
    "twin": (_ID, _Argument("DOUBLED", 0, 1, required=False)),
}
"""Kinds of faults and their arguments.

lost, corrupted, late, garbage: share of the answers that are lost, have a flipped bit,
come later, follow random bytes; from then on, until the kind comes again with share 0.
stuffed: the servo calls its position `STUFFED_POSITION`, which needs byte stuffing.
gone: off the bus, for good or for a time, with its torque unchanged. reboot: restarts,
as after a drop of the supply. hot: heats up until it shuts down. overload: shuts down.
stalled: the motor is jammed. snapped: the cable is torn. voltage: of the supply.
unplug: the port disappears for a time. model: the servo states another model number.
twin: another servo has the same id; both answer at once, so that measurements damage
each other, or, with DOUBLED 1, one after the other.
"""
LINE_KINDS = frozenset(("lost", "corrupted", "late", "garbage"))


@dataclass(frozen=True)
class Fault:
    """One scheduled fault.

    Attributes:
        time: when it occurs [s].
        after_torque: whether the time counts from the first torque, not from the start.
        kind: a name in `KINDS`.
        values: its arguments.
    """

    time: float
    after_torque: bool
    kind: str
    values: tuple[float, ...]


def parse_faults(texts: Sequence[str], ids: Sequence[int]) -> tuple[Fault, ...]:
    """Parse faults such as `EXAMPLE`.

    Args:
        texts: one fault each.
        ids: of the servos.

    Raises:
        S2C2AError: a fault has no valid time, kind or arguments.
    """
    return tuple(_parse_fault(text, ids) for text in texts)


def _parse_fault(text: str, ids: Sequence[int]) -> Fault:
    words = text.split()
    after_torque = text.strip().startswith(AFTER_TORQUE)
    try:
        time = float(words[0].removeprefix(AFTER_TORQUE))
        kind = words[1]
        fault = Fault(time, after_torque, kind, tuple(map(float, words[2:])))
    except (ValueError, IndexError) as error:
        raise _invalid_fault(text) from error
    if not (0 <= time < float("inf") and _has_valid_arguments(fault)):
        raise _invalid_fault(text)
    if KINDS[kind][0] is _ID and fault.values[0] not in ids:
        raise S2C2AError(
            f"'{text}' names servo {fault.values[0]:g}; the arm has the servos "
            f"{', '.join(map(str, ids))}"
        )
    return fault


def _has_valid_arguments(fault: Fault) -> bool:
    arguments = KINDS.get(fault.kind)
    if arguments is None or len(fault.values) > len(arguments):
        return False
    if len(fault.values) < sum(argument.required for argument in arguments):
        return False
    pairs = zip(fault.values, arguments, strict=False)
    return all(argument.low <= value <= argument.high for value, argument in pairs)


def _suggested(text: str) -> str:
    kind = "".join(text.split()[1:2])
    return "" if kind in KINDS else did_you_mean(kind, KINDS)


def _invalid_fault(text: str) -> S2C2AError:
    kinds = [" ".join((kind, *map(_describe, KINDS[kind]))) for kind in KINDS]
    return S2C2AError(
        f"'{text}' is not a fault{_suggested(text)}; write a time [s] (after "
        f"'{AFTER_TORQUE}', from the "
        f'first torque on) and one of: {", ".join(kinds)}; for example "{EXAMPLE}", '
        f'"{AFTER_TORQUE}5 snapped 2"'
    )


def _describe(argument: _Argument) -> str:
    return argument.name if argument.required else f"[{argument.name}]"


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
        for fault in sorted(due, key=lambda fault: fault.time):
            apply_fault(fault, emulator)

    def _is_due(self, fault: Fault, now: float) -> bool:
        if not fault.after_torque:
            return fault.time <= now
        return self._torque_time is not None and self._torque_time + fault.time <= now


def apply_fault(fault: Fault, emulator: "Emulator") -> None:
    """Let a fault occur now."""
    if fault.kind in LINE_KINDS:
        emulator.disturbances.set(fault.kind, fault.values)
    elif fault.kind == "voltage":
        emulator.voltage = fault.values[0]
    elif fault.kind == "unplug":
        emulator.unplug(fault.values[0])
    else:
        _apply_to_servo(fault, emulator)


def _apply_to_servo(fault: Fault, emulator: "Emulator") -> None:
    winch = next(
        one for one in emulator.winches if one.original_id == int(fault.values[0])
    )
    servo = winch.servo
    match fault.kind:
        case "stuffed":
            servo.shift_position(STUFFED_POSITION)
        case "gone":
            seconds = fault.values[1] if len(fault.values) > 1 else float("inf")
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
            servo["model_number"] = int(fault.values[1])
        case "twin":
            is_doubled = len(fault.values) > 1 and fault.values[1] > 0
            emulator.disturbances.twins[servo.id] = is_doubled


class Disturbances:
    """What happens to answers on the line.

    Attributes:
        twins: ids that two servos have; whether their answers follow each other.
    """

    def __init__(self, random: np.random.Generator):
        """Begin without disturbances.

        Args:
            random: decides which answers are hit.
        """
        self._random = random
        self._values: dict[str, tuple[float, ...]] = {}
        self.twins: dict[int, bool] = {}

    def set(self, kind: str, values: tuple[float, ...]) -> None:
        """Set the arguments of a kind in `LINE_KINDS` from now on."""
        self._values[kind] = values

    def disturb(self, answers: list[Answer]) -> list[Answer]:
        """Return answers as they leave the line; a lost one is empty."""
        if self.twins:
            answers = [self._answer_twice(answer) for answer in answers]
        if not self._values:
            return answers
        return [self._disturb(answer) for answer in answers]

    def _answer_twice(self, answer: Answer) -> Answer:
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

    def _disturb(self, answer: Answer) -> Answer:
        if self._hits("late"):
            delay = answer.delay + self._values["late"][0]
            answer = replace(answer, delay=delay)
        if self._hits("corrupted"):
            answer = replace(answer, data=self._flip_bit(answer.data))
        if self._hits("garbage"):
            size = self._random.integers(1, _LONGEST_GARBAGE + 1)
            answer = replace(answer, data=self._random.bytes(int(size)) + answer.data)
        if self._hits("lost"):
            answer = replace(answer, data=b"")
        return answer

    def _hits(self, kind: str) -> bool:
        values = self._values.get(kind)
        return values is not None and self._random.random() < values[-1]

    def _flip_bit(self, data: bytes) -> bytes:
        flipped = bytearray(data)
        place = self._random.integers(len(flipped))
        flipped[place] ^= 1 << int(self._random.integers(8))
        return bytes(flipped)
