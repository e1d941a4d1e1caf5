"""Pulleys of emulated servos."""

import numpy as np
import pytest

from s2c2a.lab.emulation.servo import MotorState
from s2c2a.lab.emulation.winch import Pulley, Winch
from s2c2a.lab.emulation.xl330 import XL330


@pytest.mark.parametrize("growth", [0.0, 0.0004])
@pytest.mark.parametrize("turns", [-1.5, 0.0, 0.3, 4.0])
def test_turns_and_length_of_a_pulley_agree(growth, turns):
    pulley = Pulley(0.01, growth)
    assert pulley.turns(pulley.length(turns)) == pytest.approx(turns)


def test_a_growing_pulley_winds_more_with_every_turn():
    pulley = Pulley(0.01, 0.001)
    assert pulley.length(1.0) == pytest.approx(2 * np.pi * 0.0105)
    assert pulley.radius_at(pulley.length(2.0)) == pytest.approx(0.012)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("growth", [0.0, 0.0004])
def test_ticks_and_displacements_agree(direction, growth):
    servo = XL330(1, MotorState())
    winch = Winch(servo, 1, 0, direction, Pulley(0.01, growth), home_ticks=700.0)
    assert winch.displacement(700.0) == 0.0
    assert np.sign(winch.displacement(800.0)) == direction
    assert winch.displacement(winch.ticks(-0.02)) == pytest.approx(-0.02)
