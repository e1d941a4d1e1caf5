"""Programs are shared by what differs in numbers, and by nothing else."""

import logging
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.execution import compilation
from s2c2a.execution.compilation import MAX_UNROLLED, compiled, scan


class Line(eqx.Module):
    slope: jax.Array
    offset: float
    names: tuple = eqx.field(static=True, default=())

    def __call__(self, x):
        return self.slope * x + self.offset


class Pair(NamedTuple):
    line: Line
    shift: np.ndarray


def evaluated_by_line(line, x):
    return line(x)


def evaluated_by_pair(pair, power, x):
    return pair.line(x + pair.shift) ** power


def a_line(slope, offset=1.0, *names):
    return Line(jnp.asarray(slope), offset, names)


def compilations(caplog, call):
    caplog.clear()
    with jax.log_compiles(), caplog.at_level(logging.DEBUG):
        call()
    messages = [record.getMessage() for record in caplog.records]
    return sum("Finished XLA compilation of jit(evaluated" in text for text in messages)


def test_other_numbers_of_the_same_shape_share_a_program(caplog):
    x = np.float32(2.0)
    first, second = (compiled(evaluated_by_line, a_line(slope)) for slope in (3.0, 5.0))
    assert compilations(caplog, lambda: first(x)) == 1
    assert compilations(caplog, lambda: second(x)) == 0
    assert (float(first(x)), float(second(x))) == (7.0, 11.0)


OTHERS = {
    "a leaf": (a_line(3.0, 10.0), a_line(3.0, 20.0), [16.0, 26.0]),
    "a static field": (a_line(1.0, 0.5, "a"), a_line(1.0, 0.5, "b"), [2.5, 2.5]),
}


@pytest.mark.parametrize(("one", "other", "values"), OTHERS.values(), ids=OTHERS)
def test_other_leaves_and_static_fields_make_other_programs(caplog, one, other, values):
    x = np.float32(2.0)
    programs = [compiled(evaluated_by_line, line) for line in (one, other)]
    assert compilations(caplog, lambda: [program(x) for program in programs]) == 2
    assert [float(program(x)) for program in programs] == values


def test_equal_numbers_of_different_types_have_separate_programs():
    programs = [compiled(jnp.multiply, number) for number in (1, 1.0, True)]
    kinds = [program(np.int32(3)).dtype.kind for program in programs]
    assert kinds == ["i", "f", "i"]


def test_shapes_have_separate_programs():
    lines = [Line(jnp.arange(size, dtype=jnp.float32), 0.0) for size in (2, 3)]
    answers = [compiled(evaluated_by_line, line)(np.float32(2.0)) for line in lines]
    assert [answer.tolist() for answer in answers] == [[0.0, 2.0], [0.0, 2.0, 4.0]]


def test_parts_can_hold_numpy_arrays_in_any_tree():
    pair = Pair(a_line(2.0, 0.0), np.array([1.0, 2.0], np.float32))
    found = compiled(evaluated_by_pair, pair, 2)(np.float32(1.0))
    np.testing.assert_allclose(found, [16.0, 36.0])


def test_without_parts_and_without_a_name_it_compiles_all_the_same():
    assert float(compiled(partial(jnp.add, 1.0))(np.float32(2.0))) == 3.0


@pytest.mark.parametrize("steps", [1, 3, MAX_UNROLLED, MAX_UNROLLED + 1])
@pytest.mark.parametrize("reverse", [False, True])
def test_short_and_long_sequences_are_scanned_in_the_same_order(steps, reverse):
    values = np.random.default_rng(0).normal(size=(2, steps, 3)).astype(np.float32)

    def total(state, value):
        return state + value, state + value

    sums = scan(total, jnp.zeros((2, 3)), jnp.asarray(values), reverse)
    order = slice(None, None, -1 if reverse else 1)
    expected = np.cumsum(values[:, order], axis=1)[:, order]
    np.testing.assert_allclose(sums, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.skipif(not compilation.MAPS.exists(), reason="Linux only")
def test_programs_are_forgotten_only_if_there_are_too_many():
    compiled = jax.jit(lambda x: 2.0 * x)
    compiled(1.0)
    assert not compilation.forget_programs(max_maps=10**9)
    assert compiled._cache_size() == 1
    assert compilation.forget_programs(max_maps=1)
    assert compiled._cache_size() == 0
