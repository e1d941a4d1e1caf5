"""Answers of servos to instructions, before they are on the wire."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Answer:
    """Bytes that one servo sends.

    Attributes:
        id: of the servo.
        data: the bytes.
        delay: time between the end of what was sent before and the first byte [s].
    """

    id: int
    data: bytes
    delay: float
