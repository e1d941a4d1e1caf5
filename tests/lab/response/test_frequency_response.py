"""Frequency response: recovered from synthetic data, measured on simulated arms."""

import json

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.backlash import play_along
from s2c2a.errors import S2C2AError
from s2c2a.estimation import ModalFactors
from s2c2a.kinematics import configurations_from_bends
from s2c2a.lab.cli.response import (
    cells,
    compare_responses,
    kept,
    measure_response,
)
from s2c2a.lab.response.delayed_response import second_order_response
from s2c2a.lab.response.excitation import AMPLITUDE, chirp_around, excite
from s2c2a.lab.response.expected_response import (
    equilibria_by_description,
    equilibria_by_model,
    expected_tilts,
)
from s2c2a.lab.response.frequency_response import (
    Response,
    fit_response,
    spectrum,
)
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.robots import Robot
from s2c2a.robots.simulation import SimulatedRobot

from marks import slow_after

PERIOD = 0.1


class Showing(Robot):
    """A simulated arm that says some of what it could."""

    own_time = True

    def __init__(self, arm, *names: str, stops_at: int | None = None, **options):
        self.arm, self._inner, self._names = arm, SimulatedRobot(arm, **options), names
        self._stops_at, self.reads, self.closed, self.sent = stops_at, 0, 0, []

    @property
    def sensors(self):
        return {
            name: sensor
            for name, sensor in self._inner.sensors.items()
            if name in self._names
        }

    def open(self):
        return self._inner.open()

    def read(self):
        self.reads += 1
        if self.reads == self._stops_at:
            raise KeyboardInterrupt
        whole = self._inner.read()
        return type(whole)(whole.time, {name: whole[name] for name in self._names})

    def send(self, action):
        self.sent.append(action)
        return self._inner.send(action)

    def advance(self, seconds):
        self._inner.advance(seconds)

    def close(self):
        self.closed += 1


class Metal(Showing):
    """The same on the wall's clock, which must lead it to rest."""

    own_time = False

    def read(self):
        self._inner.advance(self.arm.control_period)
        return super().read()

    def advance(self, seconds):
        """Time passes as the wall's does."""


def delayed_mode(held, frequency, damping, delay):
    """Tilts at the steps, in which commands are held; the delay is in steps."""
    fine = 1000
    path = np.repeat(held - held[0], fine)
    swung = second_order_response(path, PERIOD / fine, frequency, damping)
    moments = np.arange(len(held)) - delay
    return held[0] + np.interp(moments, np.arange(len(path)) / fine, swung)


def asked_of(arm, frequency=1.5):
    return chirp_around(arm, frequency).sum(axis=-1)


@pytest.mark.parametrize(
    ("frequency", "damping"), slow_after(1, [(1.5, 0.11), (0.9, 0.3), (2.2, 0.7)])
)
@pytest.mark.parametrize("delay", slow_after(1, [0.3, 2.6]))
def test_mode_delay_gain_and_loss_are_found_again_under_noise(
    twin, frequency, damping, delay
):
    asked = asked_of(twin)
    passed = play_along(asked[0], asked - 0.03, asked + 0.03)
    seen = 0.8 * delayed_mode(passed, frequency, damping, delay)
    seen += np.random.default_rng(0).normal(0, 0.003, len(seen)) + np.linspace(
        0.0, 0.05, len(seen)
    )
    seen[100:110] = np.nan
    found = fit_response(asked, seen, PERIOD, 1.5)
    assert found.frequency == pytest.approx(frequency, rel=0.03)
    assert found.damping == pytest.approx(damping, rel=0.1)
    assert found.gain == pytest.approx(0.8, rel=0.05)
    assert found.delay == pytest.approx(delay, abs=0.2)
    assert found.backlash == pytest.approx(0.03, abs=0.006)
    assert found.residual < 0.1


def test_a_vibration_from_rest_is_that_of_a_simulation_in_small_steps():
    # held from one step on, felt at 1.25
    held, fine, rate = np.array([0.0, *[1.0] * 20]), 1000, 2 * np.pi * 1.5
    swung, x, v = [0.0], 0.0, 0.0
    for step in range(20 * fine):
        desired = float(step >= 1.25 * fine)
        v += (rate**2 * (desired - x) - 2 * 0.2 * rate * v) * PERIOD / fine
        x += v * PERIOD / fine
        if (step + 1) % fine == 0:
            swung.append(x)
    np.testing.assert_allclose(delayed_mode(held, 1.5, 0.2, 0.25), swung, atol=0.01)


def test_a_spectrum_of_what_is_half_as_much_and_a_step_late_says_so(twin):
    asked = asked_of(twin)
    frequencies, gains = spectrum(asked, 0.5 * np.roll(asked, 1), PERIOD)
    np.testing.assert_allclose(np.abs(gains), 0.5, rtol=0.02)
    np.testing.assert_allclose(
        np.angle(gains), -2 * np.pi * frequencies * PERIOD, atol=0.05
    )


def test_nothing_seen_is_refused(twin):
    asked = asked_of(twin)
    with pytest.raises(S2C2AError, match="no response"):
        fit_response(asked, np.full(len(asked), np.nan), PERIOD, 1.5)
    with pytest.raises(S2C2AError, match="no response"):
        fit_response(asked, np.zeros(len(asked)), PERIOD, 1.5)


@pytest.mark.parametrize("rate", [5.0, 10.0, 100.0])
@pytest.mark.parametrize("modules", [1, 8])
def test_a_chirp_is_small_and_within_the_limits_and_ends_at_rest(
    make_arm, modules, rate
):
    arm = make_arm(modules, control_rate=rate)
    waves, step = chirp_around(arm, 1.5), np.deg2rad(arm.step_limit_deg)
    assert (np.abs(waves) <= AMPLITUDE * ArmGeometry.of(arm).bend_limits + 1e-9).all()
    assert np.abs(np.diff(waves, axis=0)).max() <= step
    assert np.abs(np.diff(waves, n=2, axis=0)).max() <= 1.5 * step
    assert np.abs(waves[-10:]).max() == 0.0
    assert np.abs(waves).sum(axis=1).max() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "frequency", "damping"),
    slow_after(1, [(0.0, 1.52, 0.14), (0.05, 1.01, 0.11)]),
)
def test_the_twin_vibrates_as_it_does_after_a_push_and_more_slowly_with_a_load(
    twin, load, frequency, damping
):
    asked, seen = excite(SimulatedRobot(twin, payload=load), 1.6).tilts(0)
    found = fit_response(asked, seen, PERIOD, 1.6)
    assert found.frequency == pytest.approx(frequency, rel=0.1)
    assert found.damping == pytest.approx(damping, rel=0.15)
    assert found.residual < 0.15


@pytest.mark.slow
def test_inertial_sensors_show_the_same_as_true_states(simulated):
    arm = type(simulated).model_validate(
        simulated.model_dump() | {"sensors": {"imu": {}}}
    )
    found = []
    for names in (("states",), ("angular_velocities", "accelerations")):
        told = excite(Showing(arm, *names), 1.6)
        assert told.sensor == names[0]
        found.append(fit_response(*told.tilts(1), PERIOD, 1.6))
    true, felt = found
    assert felt.frequency == pytest.approx(true.frequency, rel=0.05)
    assert felt.damping == pytest.approx(true.damping, rel=0.1)
    assert felt.gain == pytest.approx(true.gain, rel=0.05)
    assert felt.delay == pytest.approx(true.delay, abs=0.2)


def test_encoders_alone_are_refused_before_anything_moves(twin):
    robot = Showing(twin, "cables")
    with pytest.raises(S2C2AError, match=r"provides cables.*inertial sensors"):
        excite(robot, 1.5)
    assert robot.sent == []


def test_an_interrupt_leaves_the_arm_at_rest_and_closed(make_arm, monkeypatch):
    # a busy machine delays readings, which is no fault here
    monkeypatch.setattr("s2c2a.runtime.readings.MAX_SILENCE", np.inf)
    robot = Metal(make_arm(control_rate=100.0), "states", stops_at=60)
    with pytest.raises(KeyboardInterrupt):
        excite(robot, 1.5)
    assert np.abs(robot.sent[-1]).max() < 1e-6 < np.abs(robot.sent[55]).max()
    assert robot.closed == 1


def test_what_the_description_expects_stretches_and_sinks(twin):
    felt = np.full((200, 3, 2), 0.05)
    rests = equilibria_by_description(twin, ModalFactors.nominal(), felt)
    tilts = expected_tilts(twin, ModalFactors.nominal(), rests)
    assert 0.5 * 0.15 < tilts[-1, 0] < 0.15
    hung = type(twin).model_validate(
        twin.model_dump() | {"gravity_direction": (0.0, 0.0, 1.0)}
    )
    assert (
        equilibria_by_description(hung, ModalFactors.nominal(), felt)[-1].sum()
        < rests[-1].sum()
    )


def test_what_a_model_expects_is_its_own(twin):
    felt = np.random.default_rng(0).normal(0, 0.1, (7, 3, 2))
    sensed = np.asarray(configurations_from_bends(felt))
    np.testing.assert_allclose(
        equilibria_by_model(PCCForwardModel.of(twin), sensed), felt, atol=1e-4
    )


def test_the_worse_direction_is_compared_with_the_expected_response():
    expected = Response(1.5, 0.1, 0.8, 0.2, 0.0, 0.0)
    stronger = expected._replace(gain=2.4)
    later = expected._replace(delay=2.5)
    pair = [expected, expected]
    assert "3.00 times" in compare_responses([expected, stronger], pair)
    assert "2.3 steps later" in compare_responses([expected, later], pair)


@pytest.mark.slow
def test_the_command_measures_prints_and_keeps_it(simulated, tmp_path, capsys):
    out = tmp_path / "response.json"
    measure_response(SimulatedRobot(simulated), None, out)
    said = capsys.readouterr().out
    assert "first mode [Hz]" in said
    assert "the gain is" in said
    found = json.loads(out.read_text())
    assert found["measured"]["x"]["frequency"] == pytest.approx(1.77, rel=0.1)
    assert (tmp_path / "response.json.png").stat().st_size > 10_000


def test_a_mode_that_is_too_fast_for_the_control_rate_is_not_made_up(twin):
    asked = asked_of(twin, 12.0)
    seen = 0.8 * delayed_mode(asked, 13.0, 0.5, 0.2)
    found = fit_response(asked, seen, PERIOD, 12.0)
    assert cells(found)[:2] == ("too fast to see", "-")
    assert kept(found)["frequency"] is None
    assert found.gain == pytest.approx(0.8, rel=0.05)
