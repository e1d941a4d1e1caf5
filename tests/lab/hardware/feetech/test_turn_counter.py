"""Turns are counted across the step from 4095 to 0."""

from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.hardware.feetech.turns import TurnCounter

STEPS = st.lists(st.integers(-2047, 2047), max_size=50)


@given(st.integers(0, 4095), STEPS)
def test_any_motion_of_less_than_half_a_turn_a_read_is_followed(start, steps):
    counter = TurnCounter(4096)
    counter.unwrap(2, 4095 - start)  # another servo
    position = counter.unwrap(1, start)
    assert position == start
    for step in steps:
        position += step
        assert counter.unwrap(1, position % 4096) == position
