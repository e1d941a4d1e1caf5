"""Backlash, capstan friction and creep: hysteresis loops, limits, time constants."""

import numpy as np
import pytest

from s2c2a.arm import Cable
from s2c2a.robots.simulation.transmission import CableTransmission

STRAIGHT, SLACK = np.zeros(1), np.zeros((1, 3))


@pytest.fixture
def transmission(make_arm):
    """Builds the transmission of a one-module displacement arm, at rest."""

    def make(**cable) -> CableTransmission:
        return CableTransmission(
            make_arm(modules=1, module={"cable": Cable(**cable)}), np.zeros((1, 3))
        )

    return make


@pytest.fixture
def tension_transmission(make_arm):
    """Builds the transmission of a one-module tension arm whose cables hold 10 N."""

    def make(**cable) -> CableTransmission:
        module = {"tension_range": 20.0, "pretension": 10.0, "cable": Cable(**cable)}
        return CableTransmission(
            make_arm(modules=1, actuation="tension", module=module),
            np.full((1, 3), 10.0),
        )

    return make


def drive(
    transmission,
    targets,
    steps=20,
    period=0.1,
    tensions=SLACK,
    bends=STRAIGHT,
    start=0.0,
):
    """Return the first cable's displacement at the module after each target."""
    felt, position = [], start
    times = period * np.arange(1, steps + 1) / steps
    for target in targets:
        path = position + (target - position) * times / period
        cables = np.broadcast_to(path[:, None, None], (steps, 1, 3))
        felt.append(transmission.transmit(cables, times, tensions, bends)[-1, 0, 0])
        position = target
    return np.array(felt)


def test_backlash_makes_a_loop_twice_its_half_width_wide(transmission):
    """Half-width 1 mm, by hand: up, back through the dead band, down, up again."""
    targets = 1e-3 * np.array(
        [0.5, 1.0, 5.0, 4.0, 3.0, 2.0, -5.0, -4.0, -3.0, -2.0, 5.0, 0.0]
    )
    expected = 1e-3 * np.array(
        [0.0, 0.0, 4.0, 4.0, 4.0, 3.0, -4.0, -4.0, -4.0, -3.0, 4.0, 1.0]
    )
    np.testing.assert_allclose(
        drive(transmission(backlash=1e-3), targets), expected, atol=1e-15
    )


@pytest.mark.parametrize("steps", [1, 7, 50])
def test_backlash_does_not_depend_on_the_physics_step(transmission, steps):
    targets = np.random.default_rng(3).uniform(-4e-3, 4e-3, 40)
    coarse, fine = (
        drive(transmission(backlash=1e-3), targets, count) for count in (steps, 20)
    )
    np.testing.assert_allclose(coarse, fine, atol=1e-15)


def half_width(losing, tension: float, bends=STRAIGHT) -> float:
    """How far the first cable's module lags behind a motor that has moved far."""
    return (
        0.05 - drive(losing, [0.05], tensions=np.full((1, 3), tension), bends=bends)[0]
    )


def test_the_capstan_band_is_the_stretch_of_what_friction_holds(transmission):
    """T (exp(mu angle) - 1) / k = 12 N (e^(0.2 pi/2) - 1) / (3000 N/m)."""
    losing = transmission(friction=0.2, friction_angle_deg=90.0, stiffness=3000.0)
    assert half_width(losing, 12.0) == pytest.approx(
        12.0 * (np.exp(0.1 * np.pi) - 1) / 3000.0
    )


def test_the_capstan_band_grows_with_tension_and_adds_to_backlash(transmission):
    friction = {"friction": 0.2, "stiffness": 3000.0}
    slack, one, two = (
        half_width(transmission(**friction), tension) for tension in (0.0, 5.0, 10.0)
    )
    both = half_width(transmission(backlash=1e-3, **friction), 5.0)
    assert one > 1e-4
    assert (slack, two, both) == pytest.approx((0.0, 2 * one, one + 1e-3))


def test_the_capstan_band_grows_with_the_bends_below_and_no_others(make_arm):
    """Module III's tube runs through modules I and II; module I's through none."""
    cable = Cable(friction=0.3, friction_angle_deg=0.0, stiffness=2000.0)
    losing = CableTransmission(make_arm(module={"cable": cable}), np.zeros((3, 3)))
    bends, tensions = np.array([0.5, 0.25, 1.0]), np.full((3, 3), 8.0)
    path = np.full((1, 3, 3), 0.05)
    felt = losing.transmit(path, np.array([0.1]), tensions, bends)
    expected = 8.0 * np.expm1(0.3 * np.array([0.0, 0.5, 0.75])) / 2000.0
    np.testing.assert_allclose(0.05 - felt[0], np.repeat(expected[:, None], 3, axis=1))


def test_friction_of_a_tension_arm_acts_in_both_directions(tension_transmission):
    """The output is e^(-mu angle) in pulling and e^(+mu angle) in releasing."""
    part = np.exp(-0.25 * np.pi / 2)
    losing = tension_transmission(friction=0.25, friction_angle_deg=90.0)
    felt = drive(losing, [30.0, 30.0 * part**1.5, 30.0 * part**3, 0.0], start=10.0)
    np.testing.assert_allclose(
        felt, [30.0 * part, 30.0 * part, 30.0 * part**2, 0.0], atol=1e-12
    )


def test_creep_takes_back_its_share_of_a_held_motion(transmission):
    """After a ramp of time T: c (1 - (tau / T) (1 - e^(-T / tau))); finally c."""
    felt = drive(transmission(creep=0.3, creep_time=2.0), [0.01] * 400)
    during_ramp = 1 - 20 * (1 - np.exp(-0.05))
    assert 0.01 - felt[0] == pytest.approx(0.3 * 0.01 * during_ramp, rel=0.06)
    assert felt[-1] == pytest.approx(0.7 * 0.01)
    assert np.max(np.diff(felt)) < 1e-15


def test_creep_has_its_time_constant(transmission):
    """After one time constant, 1/e of the creep is still to come."""
    creeping = transmission(creep=0.4, creep_time=3.0)
    felt = drive(creeping, [0.01] * 30, start=0.01)
    assert felt[-1] == pytest.approx(0.01 - 0.4 * 0.01 * (1 - np.exp(-1)))


def test_creep_does_not_depend_on_the_time_steps(transmission):
    coarse, fine = (transmission(creep=0.4, creep_time=3.0) for _ in range(2))
    drive(coarse, [0.01] * 10, period=0.1, start=0.01)
    drive(fine, [0.01] * 100, period=0.01, start=0.01)
    np.testing.assert_allclose(coarse.crept, fine.crept)


def test_backlash_absorbs_creep_within_its_band(transmission):
    """The motor moves 10 mm and stops; creep then stays within the backlash band.

    Creep reverses the path within a step, so backlash is not a clip of its start.
    """
    times = 0.005 * np.arange(1, 21)
    out = np.where(times <= 0.01, times / 0.01, 1.0)[:, None, None] * np.full(
        (1, 3), 0.01
    )
    losing = transmission(backlash=1e-3, creep=0.3, creep_time=1.0)
    felt = losing.transmit(out, times, SLACK, STRAIGHT)[:, 0, 0]
    assert np.min(np.diff(felt)) >= 0
