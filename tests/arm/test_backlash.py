import jax.numpy as jnp
import numpy as np

from s2c2a.arm.backlash import play, play_along


def test_a_reversal_passes_after_the_backlash_only():
    path = np.array([[0.0], [2.0], [1.5], [0.5]])
    moved = play_along(path[0], path - 0.5, path + 0.5)
    assert moved[:, 0].tolist() == [0.0, 1.5, 1.5, 1.0]


def test_a_monotone_path_needs_one_step():
    path = np.linspace(0.0, 1.0, 9)[:, None]
    start = np.array([0.1])
    along = play_along(start, path - 0.2, path + 0.3)
    np.testing.assert_array_equal(along, play(start, path - 0.2, path + 0.3))


def test_arrays_of_jax_and_numpy_give_the_same():
    last, low, high = np.random.default_rng(0).normal(size=(3, 5)).astype(np.float32)
    low, high = np.minimum(low, high), np.maximum(low, high)
    by_jax = play(*map(jnp.asarray, (last, low, high)))
    np.testing.assert_array_equal(by_jax, play(last, low, high))
