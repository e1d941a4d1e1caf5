"""Turns are counted across the step from 4095 to 0."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.hardware.feetech.turns import TurnCounter

STEPS = st.lists(st.integers(-2047, 2047), max_size=50)


@pytest.fixture
def counter():
    return TurnCounter(4096)


@pytest.mark.parametrize(
    ("first", "second", "expected"), [(4090, 5, 4101), (5, 4090, -6), (100, 90, 90)]
)
def test_a_step_over_the_end_of_a_turn_is_counted(counter, first, second, expected):
    counter.unwrap(1, first)
    assert counter.unwrap(1, second) == expected


def test_servos_are_counted_apart(counter):
    counter.unwrap(1, 4090)
    assert counter.unwrap(2, 5) == 5


@given(st.integers(0, 4095), STEPS)
def test_any_motion_of_less_than_half_a_turn_a_read_is_followed(start, steps):
    counter = TurnCounter(4096)
    position = counter.unwrap(1, start)
    for step in steps:
        position += step
        assert counter.unwrap(1, position % 4096) == position
