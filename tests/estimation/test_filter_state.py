"""Names of the filter's state and their places in vectors and matrices."""

import jax.numpy as jnp
import numpy as np

from s2c2a.estimation.filter_state import ArmState, StateOrder

ORDER = StateOrder.of(bends=4, bias_counts=[0, 3, 2])
STATE = ArmState(
    payload=jnp.asarray(1.0),
    bend_biases=2.0 + jnp.arange(4.0),
    bends=10.0 + jnp.arange(4.0),
    bend_rates=20.0 + jnp.arange(4.0),
    sensor_biases=30.0 + jnp.arange(5.0),
)


def test_every_place_holds_the_part_of_its_name():
    vector = STATE.packed()
    assert len(vector) == ORDER.size
    np.testing.assert_array_equal(vector[ORDER.payload], [1.0])
    np.testing.assert_array_equal(vector[ORDER.bend_biases], STATE.bend_biases)
    np.testing.assert_array_equal(vector[ORDER.bends], STATE.bends)
    np.testing.assert_array_equal(vector[ORDER.bend_rates], STATE.bend_rates)
    both = jnp.concatenate([STATE.bends, STATE.bend_rates])
    np.testing.assert_array_equal(vector[ORDER.vibration], both)


def test_biases_of_a_sensor_follow_those_of_the_sensors_before_it():
    vector = STATE.packed()
    none, three, two = ORDER.sensor_biases
    assert vector[none].size == 0
    np.testing.assert_array_equal(vector[three], [30.0, 31.0, 32.0])
    np.testing.assert_array_equal(vector[two], [33.0, 34.0])
