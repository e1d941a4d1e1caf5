"""Servo positions and cable displacements."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.lab.hardware.winch import Winches

RADIUS = 0.01  # m
TURN = 2 * np.pi * RADIUS  # m
TICKS = 4096


def winches(growth=0.0, home=0, direction=1):
    """Winches with one cable."""
    return Winches(np.array([[home]]), np.array([[direction]]), RADIUS, TICKS, growth)


@given(
    st.floats(-0.1, 0.1),
    st.floats(0, 0.0005),
    st.integers(-(2**20), 2**20),
    st.sampled_from([-1, 1]),
)
def test_displacements_come_back_within_a_tick(displacement, growth, home, direction):
    cable = winches(growth, home, direction)
    positions = cable.positions(np.array([[displacement]]))
    (back,) = cable.displacements(positions).ravel()
    assert back == pytest.approx(displacement, abs=TURN / TICKS)


@pytest.mark.parametrize("direction", [-1, 1])
def test_a_turn_pays_out_the_circumference(direction):
    cable = winches(home=100, direction=direction)
    (paid_out,) = cable.displacements(np.array([[100 + direction * TICKS]])).ravel()
    assert paid_out == pytest.approx(TURN)


def test_a_turn_on_a_growing_pulley_winds_in_more():
    cable = winches(growth=0.001)
    wound, paid_out = (
        cable.displacements(np.array([[ticks]])).item() for ticks in (-TICKS, TICKS)
    )
    assert wound == pytest.approx(-2 * np.pi * (0.010 + 0.0005))
    assert paid_out == pytest.approx(2 * np.pi * (0.010 - 0.0005))


def test_a_small_growth_changes_little():
    wanted = np.array([[0.03]])
    grown = winches(growth=1e-12).positions(wanted)
    np.testing.assert_array_equal(grown, winches().positions(wanted))


@pytest.mark.parametrize("turns", [-3, 0, 2])
@pytest.mark.parametrize("offset", [-2000, 0, 2000])
def test_whole_turns_that_a_servo_forgot_do_not_count(turns, offset):
    cable = winches(home=700)
    position = np.array([[700 + turns * TICKS + offset]])
    displacement = cable.in_same_turn(position).displacements(position).item()
    assert displacement == pytest.approx(offset / TICKS * TURN)


@pytest.mark.parametrize("direction", [-1, 1])
def test_a_current_that_winds_in_is_a_tension(direction):
    cable = winches(direction=direction)
    tension = cable.tensions(np.array([[-direction * 0.1]]), 0.35).item()
    assert tension == pytest.approx(0.1 * 0.35 / RADIUS)
