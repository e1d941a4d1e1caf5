"""What is heard of servos that are asked alone."""

import pytest

from s2c2a.lab.hardware.bus import Hearing
from s2c2a.lab.hardware.presence import hear

SILENT = (b"", 0)
DAMAGED = (b"?", 0)
ONE = (b"a", 1)
TWO = (b"aa", 2)


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
        # late answers are no second servo
        ([(SILENT,), (TWO,), (SILENT,)], Hearing.CLEAR),
        ([(SILENT,), (SILENT,), (TWO,)], Hearing.CLEAR),
        ([(SILENT,), (TWO,), (ONE, SILENT)], Hearing.CLEAR),
        ([(SILENT,), (TWO,), (ONE, ONE)], Hearing.CLEAR),
    ],
)
def test_answers_are_told_apart(attempts, result):
    rest = iter(attempts)
    assert hear(lambda: iter(next(rest)), len(attempts)) is result
