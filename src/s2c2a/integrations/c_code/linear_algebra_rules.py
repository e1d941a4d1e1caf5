"""Rules of products of matrices, factorizations and solutions."""

from collections.abc import Sequence
from math import prod
from typing import Any

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.array_rules import (
    Values,
    add_loops,
    block,
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
    left = _grouped(writer.program.stored(values[0]), batch[0], contracted[0])
    right = _grouped(writer.program.stored(values[1]), batch[1], contracted[1])
    result = new_result(writer, equation)
    shape = result.shape
    outer = index_names(shape)
    target = result.at(outer)
    batches = len(batch[0])
    left_free = len(left.shape) - len(contracted[0])
    right_free = len(right.shape) - len(contracted[0])
    length = left.shape[left_free:]

    def elements(summed: Indices) -> tuple[str, str]:
        left_indices = (*outer[:left_free], *summed)
        right_indices = (*outer[:batches], *outer[left_free:], *summed)
        return left.at(left_indices), right.at(right_indices)

    summed = index_names(length, "r")
    is_float = left.kind == "float"
    if (
        is_float
        and right_free
        and prod(length) >= SHORT
        and right.strides[right_free - 1] == 1
        and right.shape[right_free - 1] >= SHORT
    ):
        # add rows of the right side, so that the inner loop is over neighbors
        first, second = elements(summed)
        order = (*shape[:-1], *length, shape[-1])
        names = (*outer[:-1], *summed, outer[-1])
        add_loops(writer, shape, outer, f"{target} = 0;")
        add_loops(writer, order, names, f"{target} += {first} * {second};")
    elif (
        is_float
        and len(length) == 1
        and length[0] >= 2 * SHORT
        and left.strides[-1] == right.strides[-1] == 1
    ):
        # call a function of two rows whose elements are neighbors
        first, second = elements(("0",))
        call = f"{target} = s_dot(&{first}, &{second}, {length[0]});"
        add_loops(writer, shape, outer, call)
    else:
        first, second = elements(summed)
        statements = [
            f"{result.kind} s = 0;",
            looped(length, summed, f"s += {first} * {second};"),
            f"{target} = s;",
        ]
        add_loops(writer, shape, outer, block(statements))
    return [result]


def _grouped(value: Stored, batch: Sequence[int], contracted: Sequence[int]) -> Stored:
    """Axes in the order: batch, free, contracted."""
    free = other_axes(len(value.shape), (*batch, *contracted))
    return value.permuted([*batch, *free, *contracted])


@rule("lu")
def _lu(writer: Writer, equation: Any, values: Values) -> Values:
    factors = writer.program.copied(values[0])
    pivots = new_result(writer, equation, 1)
    order = new_result(writer, equation, 2)
    *batch, rows, columns = factors.shape
    _add_calls(writer, tuple(batch), "s_lu", factors, rows, columns, pivots, order)
    return [factors, pivots, order]


@rule("cholesky")
def _cholesky(writer: Writer, equation: Any, values: Values) -> Values:
    factor = writer.program.copied(values[0])
    _add_calls(writer, factor.shape[:-2], "s_cholesky", factor, factor.shape[-1])
    return [factor]


@rule("triangular_solve")
def _triangular(writer: Writer, equation: Any, values: Values) -> Values:
    params = equation.params
    if params["conjugate_a"]:
        raise S2C2AError("complex numbers cannot be exported to C")
    matrix = writer.program.stored(values[0])
    result = writer.program.copied(values[1])
    lower = params["lower"]
    is_left = params["left_side"]
    # x a = b is the transposed equation
    if params["transpose_a"] == is_left:
        matrix = _swapped(matrix)
        lower = not lower
    unknown = result if is_left else _swapped(result)
    _add_calls(
        writer,
        result_shape(equation)[:-2],
        "s_triangular",
        matrix,
        *matrix.strides[-2:],
        result,
        *unknown.strides[-2:],
        *unknown.shape[-2:],
        int(lower),
        int(params["unit_diagonal"]),
    )
    return [result]


def _add_calls(
    writer: Writer, batch: Shape, function: str, *arguments: Stored | int
) -> None:
    """Call a function for each matrix of many; arrays are pointers to one of theirs."""
    outer = index_names(batch)
    given = []
    for each in arguments:
        if isinstance(each, Stored):
            zeros = ["0"] * (len(each.shape) - len(outer))
            given.append(f"&{each.at((*outer, *zeros))}")
        else:
            given.append(str(each))
    add_loops(writer, batch, outer, f"{function}({', '.join(given)});")


def _swapped(array: Stored) -> Stored:
    """The transposed matrices."""
    rank = len(array.shape)
    return array.permuted([*range(rank - 2), rank - 1, rank - 2])
