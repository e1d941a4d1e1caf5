"""The disturbance filter without a closed loop: found payloads, outliers, missing values."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.estimation import EstimationSettings
from s2c2a.estimation.outliers import REJECTION_TIME
from s2c2a.kinematics import bends_from_states, configurations_from_bends
from s2c2a.models.session import DayChange, SessionC2S
from s2c2a.spaces import POSITION
from s2c2a.strategies import estimator_of, shipped_networks

ARM = load_arm("twin_arm").model_copy(update={"sensors": Sensors(bends=True)})
BENDS = np.array([[0.35, 0.1], [0.3, 0.05], [0.25, 0.1]], np.float32)
CONFIGURATION = np.asarray(configurations_from_bends(BENDS))
PAYLOAD = 0.05
MISSING = {"configurations": np.full((3, 3), np.nan, np.float32)}


def filter_of(arm=ARM, settings=EstimationSettings()):  # noqa: B008  # frozen
    networks = replace(shipped_networks(arm), arm=arm)
    return estimator_of(networks, settings).filter


@pytest.fixture(scope="module")
def disturbance_filter():
    return filter_of()


@pytest.fixture(scope="module")
def camera():
    """Filter of an arm that a camera alone sees."""
    return filter_of(ARM.model_copy(update={"sensors": Sensors(camera=Camera())}))


@pytest.fixture(scope="module")
def update(disturbance_filter):
    return eqx.filter_jit(disturbance_filter.update)


@pytest.fixture(scope="module")
def update_camera(camera):
    return eqx.filter_jit(camera.update)


@pytest.fixture(scope="module")
def ends(camera):
    """Pictures of the arm without payload; `ends(shift)` moves them up [m]."""
    _, states = start_and_states(camera, jnp.asarray(0.0))

    def shown(shift=0.0):
        positions = np.array(states[:, POSITION], np.float32)
        positions[:-1] = np.nan
        positions[:, 2] += shift  # upwards, which no payload explains
        return {"camera_positions": positions, "camera_age": np.float32(0.0)}

    return shown


@eqx.filter_jit
def start_and_states(disturbance_filter, payload):
    """An estimate at rest, and the states where the model says that the arm is."""
    state = disturbance_filter.start(jnp.asarray(CONFIGURATION), payload)
    return state, disturbance_filter.model.predict(
        CONFIGURATION, state.hysteresis, state.moments
    )


def start(disturbance_filter, payload=0.0):
    return start_and_states(disturbance_filter, jnp.asarray(payload))[0]


@jax.jit
def shifted_configurations(states, shift):
    return configurations_from_bends(bends_from_states(states) + shift)


def measured_at(disturbance_filter, payload, shift=0.0):
    """What ideal sensors measure of an arm at rest with a payload."""
    _, states = start_and_states(disturbance_filter, jnp.asarray(payload))
    shifts = np.broadcast_to(np.float32(shift), (3, 2))
    configurations = shifted_configurations(states, shifts)
    return {"configurations": np.asarray(configurations, np.float32)}


def after(update, state, measurements, steps):
    for _ in range(steps):
        state = update(state, CONFIGURATION, measurements)
    return state


def test_a_constant_payload_is_found(disturbance_filter, update):
    measured = measured_at(disturbance_filter, PAYLOAD)
    state = after(update, start(disturbance_filter), measured, 100)
    assert float(state.mean.payload) == pytest.approx(PAYLOAD, rel=0.2)
    assert not np.any(state.histories[0].rejected_for > 0.0)


def test_no_payload_is_found_where_there_is_none(disturbance_filter, update):
    measured = measured_at(disturbance_filter, 0.0)
    state = after(update, start(disturbance_filter), measured, 50)
    assert float(state.mean.payload) < 0.003


def test_missing_measurements_leave_the_estimate_and_widen_it(
    disturbance_filter, update
):
    measured = measured_at(disturbance_filter, PAYLOAD)
    found = after(update, start(disturbance_filter), measured, 50)
    blind = after(update, found, MISSING, 20)
    assert float(blind.mean.payload) == pytest.approx(
        float(found.mean.payload), rel=1e-3
    )
    assert float(blind.covariance[0, 0]) > float(found.covariance[0, 0])


def test_an_outlier_is_rejected_for_a_while(disturbance_filter, update):
    measured = measured_at(disturbance_filter, 0.0)
    state = after(update, start(disturbance_filter), measured, 20)
    shift = np.zeros((3, 2))
    shift[0] = 0.3  # one module: no payload bends an arm so
    wrong = update(state, CONFIGURATION, measured_at(disturbance_filter, 0.0, shift))
    assert float(wrong.histories[0].rejected_for) == pytest.approx(REJECTION_TIME)
    assert float(wrong.mean.payload) < 0.003
    steps = round(REJECTION_TIME / ARM.control_period) + 12
    assert float(after(update, wrong, measured, steps).histories[0].rejected_for) == 0.0


def test_another_payload_is_not_taken_for_an_outlier(disturbance_filter, update):
    state = start(disturbance_filter)
    state = after(update, state, measured_at(disturbance_filter, 0.0), 30)
    state = after(update, state, measured_at(disturbance_filter, PAYLOAD), 60)
    assert float(state.histories[0].rejected_for) == 0.0
    assert float(state.mean.payload) == pytest.approx(PAYLOAD, rel=0.3)


@pytest.mark.slow
def test_without_estimation_the_payload_stays_as_stated():
    settings = EstimationSettings(0.03, disturbance_estimation=False)
    fixed = filter_of(settings=settings)
    state = start(fixed, 0.03)
    measured = measured_at(fixed, 0.1)
    state = after(eqx.filter_jit(fixed.update), state, measured, 10)
    assert float(state.mean.payload) == pytest.approx(0.03)


def test_the_covariance_stays_symmetric_and_positive(disturbance_filter, update):
    measured = measured_at(disturbance_filter, PAYLOAD)
    state = after(update, start(disturbance_filter), measured, 200)
    covariance = np.asarray(state.covariance, float)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > -1e-6


def test_an_update_keeps_the_types_of_the_state_so_that_the_next_one_compiles_nothing(
    disturbance_filter,
):
    payload = np.float32(0.0)
    begun = jax.eval_shape(disturbance_filter.start, CONFIGURATION, payload)
    later = jax.eval_shape(disturbance_filter.update, begun, CONFIGURATION, MISSING)
    for before, after_update in zip(
        jax.tree.leaves(begun), jax.tree.leaves(later), strict=True
    ):
        assert before.shape == after_update.shape
        assert before.dtype == after_update.dtype
        assert before.weak_type == after_update.weak_type


@pytest.mark.slow
def test_a_jump_within_the_physical_range_is_rejected_until_it_lasts(
    camera, update_camera, ends
):
    state = after(update_camera, start(camera), ends(), 60)
    assert not camera.unused(state)["camera"]
    shifted = ends(-0.15 * ARM.length)
    wrong = after(update_camera, state, shifted, 3)
    assert camera.unused(wrong)["camera"]
    assert float(np.abs(wrong.mean.bend_biases).max()) < 0.1
    lasting = after(update_camera, state, shifted, 80)
    assert not camera.unused(lasting)["camera"]


@pytest.mark.slow
def test_a_camera_is_believed_again_after_a_jump(camera, update_camera, ends):
    state = after(update_camera, start(camera), ends(), 60)
    lasting = after(update_camera, state, ends(-0.1 * ARM.length), 60)
    repaired = after(update_camera, lasting, ends(), 100)
    assert not camera.unused(repaired)["camera"]


def test_an_end_that_no_arm_reaches_is_not_used(camera, update_camera, ends):
    state = after(update_camera, start(camera), ends(), 10)
    beyond = ends(2.0 * ARM.length)
    later = after(update_camera, state, beyond, 5)
    assert float(later.histories[0].unseen_for) > 0.0


def test_bends_of_exchanged_modules_are_rejected_at_once(disturbance_filter, update):
    measured = measured_at(disturbance_filter, PAYLOAD)
    state = after(update, start(disturbance_filter), measured, 60)
    exchanged = {name: values[::-1].copy() for name, values in measured.items()}
    wrong = after(update, state, exchanged, 2)
    assert disturbance_filter.unused(wrong)["bends"]


@pytest.mark.slow
def test_currents_of_cables_that_push_are_rejected():
    motor = ARM.motor.model_copy(update={"current_noise": 0.15})
    current = filter_of(ARM.model_copy(update={"sensors": Sensors(), "motor": motor}))
    update = eqx.filter_jit(current.update)
    state = start(current)
    tensions = eqx.filter_jit(current.model.tensions)(
        CONFIGURATION, state.hysteresis, state.moments
    )
    measured = np.asarray(tensions, np.float32)
    state = after(update, state, {"tensions": measured}, 40)
    assert not current.unused(state)["current"]
    assert current.unused(after(update, state, {"tensions": -measured}, 1))["current"]


@pytest.mark.slow
def test_a_silent_sensor_is_unused(camera, update_camera, ends):
    state = after(update_camera, start(camera), ends(), 20)
    unseen = camera.sensors[0].missing()
    silence = round(camera.sensors[0].max_silence / ARM.control_period)
    assert not camera.unused(after(update_camera, state, unseen, silence - 1))["camera"]
    silent = after(update_camera, state, unseen, silence + 2)
    assert camera.unused(silent)["camera"]
    assert not camera.unused(after(update_camera, silent, ends(), 1))["camera"]


@pytest.mark.slow
def test_a_camera_teaches_biases_that_last_while_it_sees_nothing(
    camera, update_camera, ends
):
    """The walk of the biases fades within seconds, what was learned does not."""
    unseen = {name: np.full_like(value, np.nan) for name, value in ends().items()}
    shift = -0.02  # downwards, less than a jump
    state = after(update_camera, start(camera), ends(shift), 100)
    assert np.abs(state.expected_biases).max() > 0.005
    later = after(update_camera, state, unseen, 100)
    assert np.abs(later.mean.bend_biases).max() < 1e-3
    np.testing.assert_allclose(
        later.expected_biases, state.expected_biases, rtol=0.2, atol=1e-3
    )


@pytest.mark.slow
def test_rejected_pictures_and_those_after_a_jump_teach_nothing(
    camera, update_camera, ends
):
    state = after(update_camera, start(camera), ends(), 60)
    lasting = after(update_camera, state, ends(0.2 * ARM.length), 200)
    assert np.abs(lasting.expected_biases).max() < 0.01


@pytest.mark.slow
def test_without_sight_of_the_ends_no_field_is_kept(disturbance_filter):
    assert start(disturbance_filter).field is None


def test_a_tracking_that_was_turned_changes_no_bends_and_no_payload():
    arm = ARM.model_copy(update={"sensors": Sensors(bends=True, camera=Camera())})
    networks = replace(shipped_networks(arm), arm=arm)
    turned = replace(
        DayChange.none(3),
        translation=jnp.array([0.2, -0.1, 0.05]),
        rotation=jnp.deg2rad(jnp.array([40.0, 0.0, 0.0])),
    )
    model = SessionC2S.of(networks.c2s, turned)
    forward = replace(networks.trained["C2S"], network=model)
    moved = replace(networks, trained={**networks.trained, "C2S": forward})
    found = []
    for each in (networks, moved):
        estimator = estimator_of(each, EstimationSettings()).filter
        state, _ = start_and_states(estimator, jnp.asarray(0.0))
        seen = each.c2s.predict(CONFIGURATION, state.hysteresis, state.moments)
        measured = measured_at(estimator, PAYLOAD) | {
            "camera_positions": np.asarray(seen[:, POSITION]),
            "camera_age": np.zeros((), np.float32),
        }
        state = after(eqx.filter_jit(estimator.update), state, measured, 20)
        _, _, by_payload = estimator._equilibrium(state, jnp.asarray(CONFIGURATION))
        found.append([state.mean.bends, by_payload, state.mean.payload[None]])
    for plain, after_turn in zip(*found, strict=True):
        np.testing.assert_allclose(after_turn, plain, atol=1e-3, rtol=1e-2)
