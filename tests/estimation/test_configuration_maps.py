import equinox as eqx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import ReadingError, S2C2AError
from s2c2a.estimation import (
    PAPER_COUPLING,
    CoupledMap,
    UnitLengthMap,
    configuration_map_for,
)
from s2c2a.plugins.discovery import trust_code
from s2c2a.spaces import Reading

TWIN, SIMULATED = load_arm("twin_arm"), load_arm("simulated_arm")


def under(arm, coupling):
    """The arm under sensing coupling, checked anew."""
    return ArmSpec.model_validate(arm.model_dump() | {"sensing_coupling": coupling})


ENCODERS = eqx.filter_jit(configuration_map_for(TWIN))


def paper_configuration(a, turn):
    """Eqs. (2) and (3) as printed, in a frame turned by `turn` [rad] about z."""
    phi = np.sqrt(a[0] ** 2 + (a[1] - a[2]) ** 2 / 3) / 0.027
    direction = np.arctan2(-a[0], (a[1] - a[2]) / np.sqrt(3)) - np.pi / 2 + turn
    return np.array(
        [np.sin(phi) * np.cos(direction), np.sin(phi) * np.sin(direction), np.cos(phi)]
    )


def unit_vectors(seed, shape):
    vectors = np.random.default_rng(seed).normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@settings(deadline=None, max_examples=40)
@given(
    st.lists(
        st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
        min_size=3,
        max_size=3,
    )
)
def test_encoders_tell_configurations_by_equations_2_and_3(pairs):
    cables = np.array([[first, second, -first - second] for first, second in pairs])
    expected = [
        paper_configuration(a, turn)
        for a, turn in zip(cables, [0, np.pi / 3, 0], strict=True)
    ]
    np.testing.assert_allclose(
        ENCODERS({"cables": cables.astype(np.float32)}), expected, atol=3e-6
    )


def test_encoders_at_zero_tell_a_straight_arm_exactly():
    sensed = configuration_map_for(TWIN)({"cables": np.zeros((3, 3), np.float32)})
    np.testing.assert_array_equal(sensed, np.tile([0, 0, 1], (3, 1)))


def test_the_true_estimator_hands_on_the_truth_whatever_the_cables_say():
    truth = unit_vectors(1, (3,))
    estimate = configuration_map_for(SIMULATED)
    assert estimate.sensors == ("configurations",)
    sensed = estimate({"cables": np.full((3, 4), np.nan), "configurations": truth})
    np.testing.assert_allclose(sensed, truth, atol=1e-7)


def test_an_estimator_takes_what_it_needs_out_of_a_reading_in_single_precision():
    reading = Reading(0.0, {"cables": np.full((3, 3), 0.1), "flex": np.zeros(7)})
    inputs = configuration_map_for(TWIN).inputs(reading)
    assert {name: values.dtype for name, values in inputs.items()} == {
        "cables": np.dtype(np.float32)
    }


def test_configurations_follow_from_states_where_a_body_says_only_those():
    """A middle module that is bent leans the last one, which is straight in its own frame."""
    lean = [np.sin(0.5), 0.0, np.cos(0.5)]
    states = np.array(
        [[0, 0, 0.2, 0, 0, 1], [0.05, 0, 0.39, *lean], [0.1, 0, 0.5, *lean]]
    )
    inputs = configuration_map_for(SIMULATED).inputs(Reading(0.0, {"states": states}))
    np.testing.assert_allclose(
        inputs["configurations"], [[0, 0, 1], lean, [0, 0, 1]], atol=1e-6
    )


@pytest.mark.parametrize(("arm", "lacking"), [(TWIN, "cables"), (SIMULATED, "states")])
def test_a_reading_that_lacks_what_is_needed_is_refused_with_what_it_has(arm, lacking):
    with pytest.raises(
        ReadingError, match=f"no '{lacking}' in this reading; it has flex"
    ):
        configuration_map_for(arm).inputs(Reading(0.0, {"flex": np.zeros(3)}))


OWN = """
import jax.numpy as jnp
from s2c2a.estimation import ConfigurationMap

class Flex(ConfigurationMap):
    gain: float

    @property
    def sensors(self):
        return ("flex",)

    @classmethod
    def of(cls, arm):
        return cls(2.0)

    def __call__(self, sensors):
        return self.gain * jnp.asarray(sensors["flex"])

thing = 3
"""


def own_sensing(tmp_path, name):
    path = tmp_path / f"flex_{tmp_path.name}.py"
    path.write_text(OWN)
    trust_code(f"{path}:{name}")
    return ArmSpec.model_validate(TWIN.model_dump() | {"sensing": f"{path}:{name}"})


def test_an_estimator_of_ones_own_is_named_in_the_arm_file(tmp_path):
    estimate = configuration_map_for(own_sensing(tmp_path, "Flex"))
    assert estimate.sensors == ("flex",)
    np.testing.assert_array_equal(
        estimate({"flex": np.ones((3, 3))}), 2 * np.ones((3, 3))
    )


def test_what_is_no_estimator_is_refused(tmp_path):
    with pytest.raises(
        S2C2AError,
        match=r"is no sensor; derive it from s2c2a\.estimation\..*\.ConfigurationMap",
    ):
        configuration_map_for(own_sensing(tmp_path, "thing"))
    with pytest.raises(
        S2C2AError, match=r"no sensor 'nose'; choose one of encoders, true"
    ):
        configuration_map_for(
            ArmSpec.model_validate(TWIN.model_dump() | {"sensing": "nose"})
        )


@pytest.mark.parametrize("kind", [CoupledMap, UnitLengthMap])
def test_an_estimator_that_goes_round_another_one_is_not_made_from_an_arm_alone(kind):
    with pytest.raises(S2C2AError, match=f"{kind.__name__} wraps another map"):
        kind.of(TWIN)


def test_coupled_sensors_mix_modules_as_worked_by_hand():
    truth = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    sensed = configuration_map_for(under(SIMULATED, PAPER_COUPLING))(
        {"configurations": truth}
    )
    np.testing.assert_allclose(
        sensed, [[0.85, 0.10, 0.05], [0.20, 0.70, 0.10], [0.15, 0.30, 0.55]], atol=1e-7
    )


def test_coupled_encoders_mix_what_the_encoders_say():
    cables = np.array(
        [[-0.01, 0.005, 0.005], [0.0, 0.0, 0.0], [0.002, -0.004, 0.002]], np.float32
    )
    alone = np.asarray(configuration_map_for(TWIN)({"cables": cables}))
    mixed = configuration_map_for(under(TWIN, PAPER_COUPLING))({"cables": cables})
    by_hand = [sum(PAPER_COUPLING[i][j] * alone[j] for j in range(3)) for i in range(3)]
    np.testing.assert_allclose(mixed, by_hand, atol=1e-6)


@pytest.mark.parametrize(
    "matrix", [np.eye(2), np.eye(4), np.ones(3), np.ones((3, 2)), 0.5]
)
def test_a_coupling_matrix_of_another_size_is_refused(matrix):
    with pytest.raises(ValidationError, match="sensing_coupling"):
        under(TWIN, matrix)


@pytest.mark.parametrize("batch", [(7,), (2, 3)])
@pytest.mark.parametrize("coupling", [None, PAPER_COUPLING])
def test_a_whole_recording_is_its_moments_one_by_one(batch, coupling):
    estimate = eqx.filter_jit(configuration_map_for(under(TWIN, coupling)))
    cables = (
        np.random.default_rng(2).uniform(-0.01, 0.01, (*batch, 3, 3)).astype(np.float32)
    )
    sensed = estimate({"cables": cables})
    assert sensed.shape == (*batch, 3, 3)
    alone = np.array([estimate({"cables": one}) for one in cables.reshape(-1, 3, 3)])
    np.testing.assert_allclose(sensed.reshape(-1, 3, 3), alone, atol=1e-6)
