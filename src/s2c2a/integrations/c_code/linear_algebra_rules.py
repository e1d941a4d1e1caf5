"""Rules of products of matrices, factorizations and solutions."""

from collections.abc import Sequence
from math import prod
from typing import Any

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.array_rules import (
    Values,
    add_loops,
    block,
    copied,
    new_result,
)
from s2c2a.integrations.c_code.jaxprs import other_axes, result_shape
from s2c2a.integrations.c_code.program import index_names, looped
from s2c2a.integrations.c_code.values import Indices, Shape, Stored
from s2c2a.integrations.c_code.writer import Writer, rule

SHORT = 4  # elements; a call takes longer over fewer


@rule("dot_general")
def _dot(writer: Writer, equation: Any, values: Values) -> Values:
    contracted, batch = equation.params["dimension_numbers"]
    left = writer.stored(values[0])
    right = writer.stored(values[1])
    left = _grouped(left, batch[0], contracted[0])
    right = _grouped(right, batch[1], contracted[1])
    result = new_result(writer, equation)
    batches = len(batch[0])
    sums = len(contracted[0])
    if _adds_rows(left, right, sums):
        _add_rows(writer, result, left, right, batches, sums)
    elif _is_row_product(left, right, sums):
        _call_row_product(writer, result, left, right, batches)
    else:
        _add_products(writer, result, left, right, batches, sums)
    return [result]


def _grouped(value: Stored, batch: Sequence[int], contracted: Sequence[int]) -> Stored:
    """Axes in the order: batch, free, contracted."""
    free = other_axes(len(value.shape), (*batch, *contracted))
    return value.permuted([*batch, *free, *contracted])


def _adds_rows(left: Stored, right: Stored, sums: int) -> bool:
    """Whether the last free axis of the right side has neighbors in memory."""
    free = len(right.shape) - sums
    if left.kind != "float" or not free:
        return False
    length = right.shape[free:]
    if prod(length) < SHORT:
        return False
    return right.strides[free - 1] == 1 and right.shape[free - 1] >= SHORT


def _is_row_product(left: Stored, right: Stored, sums: int) -> bool:
    if left.kind != "float" or sums != 1:
        return False
    if left.shape[-1] < 2 * SHORT:
        return False
    return left.strides[-1] == 1 and right.strides[-1] == 1


def _add_rows(
    writer: Writer,
    result: Stored,
    left: Stored,
    right: Stored,
    batches: int,
    sums: int,
) -> None:
    """Add rows of the right side, so that the inner loop is over neighbors."""
    shape = result.shape
    outer = index_names(shape)
    target = result.at(outer)
    free = len(left.shape) - sums
    length = left.shape[free:]
    summed = index_names(length, "r")
    product = _product(left, right, outer, summed, batches)
    order = (*shape[:-1], *length, shape[-1])
    names = (*outer[:-1], *summed, outer[-1])
    add_loops(writer, shape, outer, f"{target} = 0;")
    add_loops(writer, order, names, f"{target} += {product};")


def _call_row_product(
    writer: Writer, result: Stored, left: Stored, right: Stored, batches: int
) -> None:
    """Call a function of two rows whose elements are neighbors in memory."""
    outer = index_names(result.shape)
    target = result.at(outer)
    left_indices, right_indices = _sides(left, outer, ("0",), batches)
    first = _pointer(left, left_indices)
    second = _pointer(right, right_indices)
    call = f"{target} = s_dot({first}, {second}, {left.shape[-1]});"
    add_loops(writer, result.shape, outer, call)


def _add_products(
    writer: Writer,
    result: Stored,
    left: Stored,
    right: Stored,
    batches: int,
    sums: int,
) -> None:
    outer = index_names(result.shape)
    target = result.at(outer)
    free = len(left.shape) - sums
    length = left.shape[free:]
    summed = index_names(length, "r")
    product = _product(left, right, outer, summed, batches)
    statements = [
        f"{result.kind} s = 0;",
        looped(length, summed, f"s += {product};"),
        f"{target} = s;",
    ]
    add_loops(writer, result.shape, outer, block(statements))


def _product(
    left: Stored, right: Stored, outer: Indices, summed: Indices, batches: int
) -> str:
    left_indices, right_indices = _sides(left, outer, summed, batches)
    first = left.at(left_indices)
    second = right.at(right_indices)
    return f"{first} * {second}"


def _sides(
    left: Stored, outer: Indices, summed: Indices, batches: int
) -> tuple[Indices, Indices]:
    """Indices of the left and of the right side, from those of the result."""
    free = len(left.shape) - len(summed)
    left_indices = (*outer[:free], *summed)
    right_indices = (*outer[:batches], *outer[free:], *summed)
    return left_indices, right_indices


def _pointer(array: Stored, indices: Indices) -> str:
    element = array.at(indices)
    return f"&{element}"


def _first_element(array: Stored, outer: Indices) -> str:
    """C expression of a pointer to one matrix or vector of many."""
    inner = len(array.shape) - len(outer)
    zeros = ["0"] * inner
    return _pointer(array, (*outer, *zeros))


@rule("lu")
def _lu(writer: Writer, equation: Any, values: Values) -> Values:
    factors = copied(writer, values[0])
    pivots = new_result(writer, equation, 1)
    order = new_result(writer, equation, 2)
    *batch, rows, columns = factors.shape
    outer = index_names(tuple(batch))
    arguments = [
        _first_element(factors, outer),
        rows,
        columns,
        _first_element(pivots, outer),
        _first_element(order, outer),
    ]
    _add_calls(writer, tuple(batch), "s_lu", arguments)
    return [factors, pivots, order]


@rule("cholesky")
def _cholesky(writer: Writer, equation: Any, values: Values) -> Values:
    factor = copied(writer, values[0])
    batch = factor.shape[:-2]
    outer = index_names(batch)
    size = factor.shape[-1]
    arguments = [_first_element(factor, outer), size]
    _add_calls(writer, batch, "s_cholesky", arguments)
    return [factor]


@rule("triangular_solve")
def _triangular(writer: Writer, equation: Any, values: Values) -> Values:
    params = equation.params
    if params["conjugate_a"]:
        raise S2C2AError("complex numbers cannot be exported to C")
    matrix = writer.stored(values[0])
    result = copied(writer, values[1])
    lower = params["lower"]
    is_left = params["left_side"]
    # x a = b is the transposed equation
    if params["transpose_a"] == is_left:
        matrix = _swapped(matrix)
        lower = not lower
    unknown = result if is_left else _swapped(result)
    batch = result_shape(equation)[:-2]
    outer = index_names(batch)
    arguments = [
        _first_element(matrix, outer),
        *matrix.strides[-2:],
        _first_element(result, outer),
        *unknown.strides[-2:],
        *unknown.shape[-2:],
        int(lower),
        int(params["unit_diagonal"]),
    ]
    _add_calls(writer, batch, "s_triangular", arguments)
    return [result]


def _add_calls(
    writer: Writer, batch: Shape, function: str, arguments: Sequence[object]
) -> None:
    """Call a function for each matrix of many."""
    given = ", ".join(map(str, arguments))
    outer = index_names(batch)
    add_loops(writer, batch, outer, f"{function}({given});")


def _swapped(array: Stored) -> Stored:
    """The transposed matrices."""
    rank = len(array.shape)
    batch = range(rank - 2)
    return array.permuted([*batch, rank - 1, rank - 2])
