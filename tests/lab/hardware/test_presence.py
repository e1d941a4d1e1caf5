"""What is heard of servos that are asked alone."""

import pytest

from s2c2a.lab.hardware.bus import Hearing
from s2c2a.lab.hardware.presence import hear

SILENT = (b"", 0)
DAMAGED = (b"?", 0)
ONE = (b"a", 1)
TWO = (b"aa", 2)


def heard(*attempts):
    """The result of attempts, each with what follows its requests."""
    rest = iter(attempts)
    return hear(lambda: iter(next(rest)), len(attempts))


@pytest.mark.parametrize(
    ("attempts", "result"),
    [
        ([(ONE, ONE)], Hearing.CLEAR),
        ([(DAMAGED,), (ONE, ONE)], Hearing.CLEAR),
        ([(SILENT,), (SILENT,), (SILENT,)], Hearing.SILENT),
        ([(ONE, DAMAGED), (ONE, DAMAGED), (ONE, DAMAGED)], Hearing.DAMAGED),
        ([(SILENT,), (SILENT,), (DAMAGED,)], Hearing.DAMAGED),
        ([(TWO,), (TWO,), (TWO,)], Hearing.DOUBLED),
        # one answer is lost
        ([(ONE, TWO), (SILENT,), (TWO,)], Hearing.DOUBLED),
    ],
)
def test_answers_are_told_apart(attempts, result):
    assert heard(*attempts) is result


@pytest.mark.parametrize(
    "attempts",
    [
        [(SILENT,), (TWO,), (SILENT,)],
        [(SILENT,), (SILENT,), (TWO,)],
        [(SILENT,), (TWO,), (ONE, SILENT)],
        [(SILENT,), (TWO,), (ONE, ONE)],
    ],
)
def test_late_answers_are_no_second_servo(attempts):
    assert heard(*attempts) is Hearing.CLEAR
