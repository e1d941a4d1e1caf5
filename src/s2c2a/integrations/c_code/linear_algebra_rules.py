"""Rules of products of matrices, factorizations and solutions."""

from collections.abc import Sequence
from math import prod
from typing import Any

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.array_rules import output_of
from s2c2a.integrations.c_code.program import Program, index_names, looped
from s2c2a.integrations.c_code.values import Stored, Value
from s2c2a.integrations.c_code.writer import Writer, rule

SHORT = 4  # elements; a call takes longer over fewer


@rule("dot_general")
def _dot(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    left, right = (writer.stored(value) for value in values)
    contracted, batch = equation.params["dimension_numbers"]
    left = _grouped(left, batch[0], contracted[0])
    right = _grouped(right, batch[1], contracted[1])
    batches, sums = len(batch[0]), len(contracted[0])
    result = writer.program.new_array(kind, shape)
    outer = index_names(shape)
    lefts = len(left.shape) - sums
    summed = index_names(left.shape[lefts:], "r")
    left_indices = (*outer[:lefts], *summed)
    right_indices = (*outer[:batches], *outer[lefts:], *summed)
    target = result.at(outer)
    product = f"{left.at(left_indices)} * {right.at(right_indices)}"
    length = left.shape[lefts:]
    if _adds_rows(left, right, sums, length):
        # rows of the right side are added, so that the inner loop is over neighbors
        order = (*shape[:-1], *length, shape[-1])
        names = (*outer[:-1], *summed, outer[-1])
        writer.program.add(looped(shape, outer, f"{target} = 0;"))
        writer.program.add(looped(order, names, f"{target} += {product};"))
    elif _is_row_product(left, right, sums, length):
        first = _pointer(left, (*outer[:lefts], "0"))
        second = _pointer(right, (*outer[:batches], *outer[lefts:], "0"))
        call = f"{target} = s_dot({first}, {second}, {length[0]});"
        writer.program.add(looped(shape, outer, call))
    else:
        total = looped(length, summed, f"s += {product};")
        statement = f"{{ {kind} s = 0; {total} {target} = s; }}"
        writer.program.add(looped(shape, outer, statement))
    return [result]


def _grouped(value: Stored, batch: Any, contracted: Any) -> Stored:
    """Axes in the order: batch, free, contracted."""
    free = [
        axis for axis in range(len(value.shape)) if axis not in (*batch, *contracted)
    ]
    return value.permuted([*batch, *free, *contracted])


def _adds_rows(left: Stored, right: Stored, sums: int, length: tuple) -> bool:
    """Whether the last free axis of the right side has neighbors in memory."""
    if left.kind != "float" or len(right.shape) <= sums or prod(length) < SHORT:
        return False
    axis = len(right.shape) - sums - 1
    return right.strides[axis] == 1 and right.shape[axis] >= SHORT


def _is_row_product(left: Stored, right: Stored, sums: int, length: tuple) -> bool:
    if left.kind != "float" or sums != 1 or length[0] < 2 * SHORT:
        return False
    return left.strides[-1] == 1 and right.strides[-1] == 1


def _pointer(array: Stored, indices: tuple[str, ...]) -> str:
    return f"&{array.at(indices)}"


@rule("custom_linear_solve")
def _linear_solve(
    writer: Writer, equation: Any, values: list[Value]
) -> Sequence[Value]:
    counts = equation.params["const_lengths"]
    skipped = counts.matvec + counts.vecmat
    constants = values[skipped : skipped + counts.solve]
    rights = values[sum(counts) :]
    return writer.write_closed(equation.params["jaxprs"].solve, [*constants, *rights])


@rule("lu")
def _lu(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    factors = _copy(writer.program, values[0])
    pivots = writer.program.new_array(*output_of(equation, 1))
    order = writer.program.new_array(*output_of(equation, 2))
    outer = index_names(shape[:-2])
    places = [
        _pointer(array, (*outer, *["0"] * rest))
        for array, rest in ((factors, 2), (pivots, 1), (order, 1))
    ]
    rows, columns = shape[-2:]
    call = f"s_lu({places[0]}, {rows}, {columns}, {places[1]}, {places[2]});"
    writer.program.add(looped(shape[:-2], outer, call))
    return [factors, pivots, order]


@rule("cholesky")
def _cholesky(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    factor = _copy(writer.program, values[0])
    outer = index_names(shape[:-2])
    place = _pointer(factor, (*outer, "0", "0"))
    writer.program.add(looped(shape[:-2], outer, f"s_cholesky({place}, {shape[-1]});"))
    return [factor]


@rule("triangular_solve")
def _triangular(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    params = equation.params
    if params["conjugate_a"]:
        raise S2C2AError("complex numbers cannot be exported to C")
    matrix = writer.stored(values[0])
    result = _copy(writer.program, values[1])
    lower, is_left = params["lower"], params["left_side"]
    # x a = b is the transposed equation
    if params["transpose_a"] == is_left:
        axes = [*range(len(shape) - 2), len(shape) - 1, len(shape) - 2]
        matrix = matrix.permuted(axes)
        lower = not lower
    unknown = result if is_left else result.permuted(_swapped(len(shape)))
    outer = index_names(shape[:-2])
    size, columns = unknown.shape[-2:]
    first = _pointer(matrix, (*outer, "0", "0"))
    second = _pointer(result, (*outer, "0", "0"))
    numbers = [*matrix.strides[-2:], second, *unknown.strides[-2:], size, columns]
    flags = [int(lower), int(params["unit_diagonal"])]
    arguments = ", ".join(str(each) for each in [first, *numbers, *flags])
    writer.program.add(looped(shape[:-2], outer, f"s_triangular({arguments});"))
    return [result]


def _swapped(axes: int) -> list[int]:
    return [*range(axes - 2), axes - 1, axes - 2]


def _copy(program: Program, value: Value) -> Stored:
    array = program.new_array(value.kind, value.shape)
    program.assign(array, value)
    return array
