"""Operations are counted as by hand, and the pieces of a plan are timed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.bench.operations import Operations, count_operations
from s2c2a.bench.profile import pieces

LEFT, RIGHT = np.ones((3, 4), np.float32), np.ones((4, 5), np.float32)


def test_a_product_of_matrices_multiplies_and_adds():
    assert count_operations(jnp.matmul, LEFT, RIGHT) == Operations(2 * 3 * 4 * 5, 0, 4 * (12 + 20 + 15))


def test_many_products_side_by_side_count_as_many():
    many = np.ones((7, 3, 4), np.float32)
    assert count_operations(jax.vmap(lambda each: each @ RIGHT), many).arithmetic == 7 * 2 * 3 * 4 * 5


def test_elements_count_one_by_one():
    found = count_operations(lambda x: jnp.tanh(x * 2.0 + 1.0).sum(), LEFT)
    assert found == Operations(arithmetic=12 + 12 + 12, transcendental=12)


def test_loops_count_as_often_as_they_turn():
    found = count_operations(lambda x: jax.lax.fori_loop(0, 10, lambda _, y: jnp.sin(y), x), LEFT)
    assert found.transcendental == 10 * 12


def test_of_branches_the_cheapest_counts():
    def either(x):
        return jax.lax.cond(x[0, 0] > 0.0, lambda: x * x * x * x, lambda: x + x)

    assert count_operations(either, LEFT).arithmetic == 12 + 1


def test_programs_within_programs_count_and_equations_are_solved_once():
    square = np.eye(6, dtype=np.float32)
    found = count_operations(jax.jit(lambda a: jnp.linalg.solve(a, a[0])), square)
    assert 2.0 / 3.0 * 6**3 <= found.arithmetic <= 2.0 / 3.0 * 6**3 + 3 * 36


@pytest.mark.parametrize("networks", ["tiny_networks", "tiny_best_networks"])
def test_a_plan_takes_longer_than_its_pieces_and_its_floor(networks, request):
    lines = pieces(request.getfixturevalue(networks), repeats=5, peak=1e12, progress=lambda done, total: None)
    found = {line.what.split(",")[0]: line.median for line in lines}
    assert found["a look at the model"] < found["one plan"]
    assert 0 < found["floor of a plan"] < found["one plan"]
    assert found["a plan over its floor"] == pytest.approx(found["one plan"] / found["floor of a plan"])
