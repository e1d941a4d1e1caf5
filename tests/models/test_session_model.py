"""The change of an arm since its training: its model, and its estimate."""

from contextlib import nullcontext

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import RecordingError
from s2c2a.kinematics import bends_from_configurations, configurations_from_bends
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.models.session import DayChange, SessionC2S, rotated
from s2c2a.models.session_fit import _Residuals, fit_session
from s2c2a.spaces import AXIS, POSITION
from s2c2a.training import TrainingData

from marks import slow_after

ARM = load_arm("twin_arm")
MODEL = PCCForwardModel.of(ARM)
TRANSLATION = np.array([3e-3, -2e-3, 3.5e-3])
ROTATION = np.deg2rad([1.0, -2.0, 2.0])
OFFSETS = np.array([[0.03, -0.02], [-0.01, 0.035], [0.02, 0.01]])


def change(**parts) -> DayChange:
    none = vars(DayChange.none(ARM.module_count))
    return DayChange(
        **{name: jnp.asarray(parts.get(name, none[name])) for name in none}
    )


def motion(samples: int = 200) -> np.ndarray:
    """Smooth bends of all modules, with noise that no model explains in the states."""
    times = np.linspace(0.0, 20.0, samples)
    rates = np.linspace(0.7, 1.9, 2 * ARM.module_count)
    waves = 0.5 * np.sin(times[:, None] * rates + np.arange(len(rates)))
    return np.asarray(configurations_from_bends(waves.reshape(samples, -1, 2)))


def data(true: DayChange, noise: float = 5e-4, tip_only: bool = False) -> TrainingData:
    sensed = motion()
    states = np.array(SessionC2S.of(MODEL, true).predict(jnp.asarray(sensed), ()))
    states += np.random.default_rng(0).normal(scale=noise, size=states.shape)
    if tip_only:
        states[:, :-1] = np.nan
    actions = np.zeros((1, len(sensed), ARM.module_count, ARM.cable_count))
    return TrainingData(ARM, sensed[None], actions, states[None])


def test_no_change_is_the_model_itself():
    sensed = jnp.asarray(motion(5))
    session = SessionC2S.of(MODEL, DayChange.none(ARM.module_count))
    np.testing.assert_allclose(
        session.predict(sensed, ()), MODEL.predict(sensed, ()), atol=1e-6
    )


def test_a_quarter_turn_rotates_x_to_y():
    turn = jnp.array([0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(
        rotated(jnp.array([[1.0, 0.0, 2.0]]), turn), [[0.0, 1.0, 2.0]], atol=1e-6
    )


def test_the_frame_turns_axes_and_leaves_their_length():
    moved = change(rotation=ROTATION, translation=TRANSLATION)
    states = SessionC2S.of(MODEL, moved).predict(jnp.asarray(motion(5)), ())
    axes = states[..., AXIS]
    np.testing.assert_allclose(np.linalg.norm(axes, axis=-1), 1.0, atol=1e-5)
    before = MODEL.predict(jnp.asarray(motion(5)), ())[..., AXIS]
    np.testing.assert_allclose(
        np.asarray(axes), np.asarray(rotated(before, jnp.asarray(ROTATION))), atol=1e-6
    )


def test_offsets_act_on_the_bends():
    sensed = motion(3)
    moved = SessionC2S.of(MODEL, change(offsets=OFFSETS)).moved(jnp.asarray(sensed))
    expected = np.asarray(bends_from_configurations(sensed)) + OFFSETS
    np.testing.assert_allclose(bends_from_configurations(moved), expected, atol=1e-5)


@pytest.mark.parametrize("tip_only", slow_after(1, [True, False]))
@pytest.mark.parametrize(
    "parts",
    [
        {"translation": TRANSLATION, "rotation": ROTATION},
        {"offsets": OFFSETS},
        {"offsets": 10 * OFFSETS},  # cables that were homed anywhere
    ],
)
def test_a_session_finds_each_cause(parts, tip_only):
    fit = fit_session(MODEL, data(change(**parts), tip_only=tip_only))
    assert fit.improves
    assert fit.after < 0.2 * fit.before
    std = vars(fit.posterior.std)
    for name, value in vars(change(**parts)).items():
        found = np.asarray(getattr(fit.posterior.change, name))
        assert (np.abs(found - value) < 4.0 * np.asarray(std[name]) + 1e-5).all(), name


def test_only_frame_and_cables_may_change_by_any_amount():
    residuals = _Residuals(MODEL, data(DayChange.none(ARM.module_count)))
    usual = residuals._grown(np.zeros_like(residuals._scales))
    grown = residuals._as_change(jnp.asarray(residuals._grown(100.0 * usual) / usual))
    for name, factors in vars(grown).items():
        expected = 1.0 if name == "softness" else 100.0
        np.testing.assert_allclose(factors, expected, rtol=1e-5, err_msg=name)


@pytest.mark.slow
def test_what_the_motion_does_not_show_keeps_its_prior():
    still = data(DayChange.none(ARM.module_count), tip_only=True)
    at_rest = np.repeat(still.sensed[:, :1], still.sensed.shape[1], axis=1)
    states = np.repeat(still.states[:, :1], still.sensed.shape[1], axis=1)
    noise = np.random.default_rng(1).normal(scale=1e-3, size=states.shape)
    fit = fit_session(MODEL, TrainingData(ARM, at_rest, still.actions, states + noise))
    assert np.max(np.asarray(fit.posterior.std.offsets)) > 0.02


@pytest.mark.parametrize("noise", [5e-4, 5e-3])
def test_a_tracking_that_was_put_up_anew_is_found_from_positions_of_the_tip(noise):
    moved = change(
        translation=[0.5, -0.3, 0.2],
        rotation=np.deg2rad([10, 35, -15]),
        offsets=OFFSETS,
    )
    seen = data(moved, noise, tip_only=True)
    seen.states[..., AXIS] = np.nan
    fit = fit_session(MODEL, seen)
    assert fit.after < 0.05 * fit.before
    for name in ("translation", "rotation"):
        error = np.abs(getattr(fit.posterior.change, name) - vars(moved)[name])
        assert (error < 4.0 * getattr(fit.posterior.std, name)).all()


@pytest.mark.parametrize("seed", range(2))
def test_axes_do_not_stand_for_a_tracking_that_moved_when_cables_were_homed(seed):
    random = np.random.default_rng(seed)
    moved = change(
        translation=random.uniform(-0.3, 0.3, 3),
        rotation=random.uniform(-0.5, 0.5, 3),
        offsets=random.uniform(-0.5, 0.5, (3, 2)),
    )
    fit = fit_session(MODEL, data(moved, 2e-3, tip_only=True))
    assert fit.improves
    assert fit.after < 0.1 * fit.before


@pytest.mark.slow
def test_axes_alone_tell_of_ends_whose_positions_are_unknown():
    seen = data(change(offsets=OFFSETS))
    seen.states[..., :-1, POSITION] = np.nan
    both = fit_session(MODEL, seen).posterior.std.offsets
    seen.states[..., :-1, AXIS] = np.nan
    tip = fit_session(MODEL, seen).posterior.std.offsets
    assert (both[:-1] < tip[:-1]).all()


@pytest.mark.parametrize(
    ("samples", "is_enough"),
    slow_after(1, [(0, False), (1, False), (99, False), (100, True)]),
)
def test_few_samples_of_the_tip_are_judged_or_refused(samples, is_enough):
    few = data(change(offsets=OFFSETS))
    few.states[0, : few.states.shape[1] - samples, -1] = np.nan
    refused = pytest.raises(RecordingError, match=f"seen in {samples} sample")
    with nullcontext() if is_enough else refused:
        fit = fit_session(MODEL, few)
        assert np.isfinite([fit.before, fit.after]).all()


def test_a_tracker_that_shows_only_noise_is_no_change_of_the_arm():
    noisy = data(DayChange.none(ARM.module_count))
    random = np.random.default_rng(2)
    noisy.states[...] = random.normal(scale=0.3, size=noisy.states.shape)
    fit = fit_session(MODEL, noisy)
    assert fit.after < fit.before
    assert not fit.improves
