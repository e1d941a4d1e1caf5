"""Operations that ONNX lacks, as functions of simpler ones, which JAX traces."""

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from s2c2a.integrations.windows import WindowAxes

Function = Callable[..., Any]
Params = dict[str, Any]
"""Parameters of an operation, by name."""
Decomposition = Callable[[Params], Function]


def _arc_tangent(y: Array, x: Array) -> Array:
    """Angle of (x, y): the arc tangent of the smaller over the larger."""
    width = jnp.abs(x)
    height = jnp.abs(y)
    larger = jnp.maximum(width, height)
    smaller = jnp.minimum(width, height)
    divisor = jnp.where(larger == 0.0, 1.0, larger)
    acute = lax.atan(smaller / divisor)
    is_steep = height > width
    angle = jnp.where(is_steep, np.pi / 2 - acute, acute)
    is_left = _has_minus(x)
    angle = jnp.where(is_left, np.pi - angle, angle)
    is_below = _has_minus(y)
    angle = jnp.where(is_below, -angle, angle)
    return angle.astype(x.dtype)


def _has_minus(number: Array) -> Array:
    """Whether a number is negative or the negative zero, of which 1 / x tells."""
    is_zero = number == 0.0
    reciprocal = 1.0 / number
    is_negative_zero = is_zero & (reciprocal < 0.0)
    return (number < 0.0) | is_negative_zero


def _log1p(x: Array) -> Array:
    """log(1 + x), corrected for the rounding of 1 + x (Kahan)."""
    one = 1.0 + x
    is_infinite = one == jnp.inf
    is_lost = (one == 1.0) | is_infinite
    rounded = one - 1.0
    rest = jnp.where(is_lost, 1.0, rounded)
    correction = x / rest
    corrected = lax.log(one) * correction
    return jnp.where(is_lost, x, corrected)


def _expm1(x: Array) -> Array:
    """exp(x) - 1, corrected for the rounding of exp(x) (Kahan)."""
    power = lax.exp(x)
    rounded = power - 1.0
    logarithm = lax.log(power)
    is_extreme = (power == jnp.inf) | (power == 0.0)
    is_plain = is_extreme | (logarithm == 0.0)
    divisor = jnp.where(is_plain, 1.0, logarithm)
    correction = x / divisor
    corrected = rounded * correction
    result = jnp.where(is_plain, rounded, corrected)
    return jnp.where(power == 1.0, x, result)


def _power_of_two(x: Array) -> Array:
    base = jnp.full_like(x, 2.0)
    return lax.pow(base, x)


def _reciprocal_root(x: Array) -> Array:
    root = lax.sqrt(x)
    return 1.0 / root


def _cube_root(x: Array) -> Array:
    root = lax.pow(lax.abs(x), 1.0 / 3.0)
    return lax.sign(x) * root


def _is_finite(x: Array) -> Array:
    size = lax.abs(x)
    return size < np.inf


def _differs(x: Array, y: Array) -> Array:
    is_equal = lax.eq(x, y)
    return ~is_equal


def _clamped(low: Any, x: Array, high: Any) -> Array:
    """The number, or the nearest one that is allowed."""
    above = jnp.maximum(x, low)
    return jnp.minimum(above, high)


def _power(params: Params) -> Function:
    exponent = params["y"]

    def power(x: Array) -> Array:
        if exponent == 0:
            return jnp.ones_like(x)
        if exponent < 0:
            divisor = power_of(x, -exponent)
            return 1.0 / divisor
        return power_of(x, exponent)

    return power


def power_of(x: Array, exponent: int) -> Array:
    """A power by as few products as its bits ask for."""
    if exponent == 1:
        return x
    half = power_of(x, exponent // 2)
    even = half * half
    if exponent % 2:
        return even * x
    return even


def _accumulation(combine: Function) -> Decomposition:
    def of(params: Params) -> Function:
        is_turned = params["reverse"]
        axis = params["axis"]

        def accumulated(x: Array) -> Array:
            return lax.associative_scan(combine, x, is_turned, axis)

        return accumulated

    return of


def chosen_case(which: Array, *cases: Array) -> Array:
    """The case of a number, element by element."""
    chosen, *others = cases
    for number, case in enumerate(others, 1):
        chosen = jnp.where(which >= number, case, chosen)
    return chosen


def _slice_at(params: Params) -> Function:
    sizes = params["slice_sizes"]

    def sliced(x: Array, *starts: Array) -> Array:
        axes = tuple(range(x.ndim))
        numbers = lax.GatherDimensionNumbers(axes, (), axes)
        at = _stacked_starts(starts)
        return lax.gather(x, at, numbers, sizes, mode="clip")

    return sliced


def _update_at(x: Array, update: Array, *starts: Array) -> Array:
    axes = tuple(range(x.ndim))
    numbers = lax.ScatterDimensionNumbers(axes, (), axes)
    at = _stacked_starts(starts)
    return lax.scatter(x, at, update, numbers, mode="clip")


def _stacked_starts(starts: Sequence[Array]) -> Array:
    """The first index along each axis, as one array."""
    indices = [start.astype(jnp.int32) for start in starts]
    return jnp.stack(indices)


def _unstacked(params: Params) -> Function:
    axis = params["axis"]

    def rows_of(x: Array) -> list[Array]:
        rows = []
        for row in range(x.shape[axis]):
            part = lax.index_in_dim(x, row, axis, keepdims=False)
            rows.append(part)
        return rows

    return rows_of


def _swapped(matrix: Array) -> Array:
    return jnp.swapaxes(matrix, -1, -2)


def _cholesky(matrix: Array) -> Array:
    """The lower factor, column by column."""
    rest = jnp.tril(matrix)
    rows = np.arange(rest.shape[-1])
    columns = []
    for row in rows:
        pivot = lax.sqrt(rest[..., row, row])
        scaled = rest[..., row] / pivot[..., None]
        column = jnp.where(rows >= row, scaled, 0.0)
        rest = rest - _outer_product(column, column)
        columns.append(column)
    return jnp.stack(columns, axis=-1)


def _outer_product(column: Array, row: Array) -> Array:
    return column[..., :, None] * row[..., None, :]


def _triangular(params: Params) -> Function:
    """Solve a x = b, or x a = b, which is its transpose."""
    is_left = params["left_side"]
    is_turned = params["transpose_a"] == is_left
    is_lower = params["lower"] != is_turned

    def solve(matrix: Array, right: Array) -> Array:
        if is_turned:
            matrix = _swapped(matrix)
        if params["unit_diagonal"]:
            matrix = _with_unit_diagonal(matrix)
        if is_left:
            return _substituted(matrix, right, is_lower)
        known = _swapped(right)
        unknown = _substituted(matrix, known, is_lower)
        return _swapped(unknown)

    return solve


def _with_unit_diagonal(matrix: Array) -> Array:
    size = matrix.shape[-1]
    is_diagonal = np.eye(size, dtype=bool)
    return jnp.where(is_diagonal, 1.0, matrix)


def _substituted(matrix: Array, right: Array, lower: bool) -> Array:
    """Solve row by row."""
    rows = range(matrix.shape[-1])
    order = rows if lower else reversed(rows)
    solutions: dict[int, Array] = {}
    for row in order:
        pivot = matrix[..., row, row]
        solution = right[..., row, :] / pivot[..., None]
        solutions[row] = solution
        column = matrix[..., :, row]
        right = right - _outer_product(column, solution)
    ordered = [solutions[row] for row in rows]
    return jnp.stack(ordered, axis=-2)


def _lu(matrix: Array) -> tuple[Array, Array, Array]:
    """LU factors, pivots and permutation, with partial pivoting."""
    factorize = jnp.vectorize(_lu_of_one, signature="(m,n)->(m,n),(k),(m)")
    return factorize(matrix)


def _lu_of_one(matrix: Array) -> tuple[Array, Array, Array]:
    height, width = matrix.shape
    rows = np.arange(height, dtype=np.int32)
    order = jnp.asarray(rows)
    pivots = []
    for row in range(min(height, width)):
        pivot = _pivot_of(matrix, row)
        pivots.append(pivot)
        moved = _exchanged(rows, row, pivot)
        matrix = matrix.at[moved].get(mode="clip")
        order = order.at[moved].get(mode="clip")
        matrix = _eliminated(matrix, row)
    return matrix, jnp.stack(pivots), order


def _pivot_of(matrix: Array, row: int) -> Array:
    """The row, of those not yet used, whose element of a column is the largest."""
    rows = np.arange(matrix.shape[0])
    sizes = jnp.abs(matrix[:, row])
    unused = jnp.where(rows >= row, sizes, -1.0)
    return lax.argmax(unused, 0, np.int32)


def _exchanged(rows: np.ndarray, row: int, pivot: Array) -> Array:
    """The numbers of the rows, with two of them in each other's place."""
    moved = jnp.where(rows == pivot, np.int32(row), rows)
    return jnp.where(rows == row, pivot, moved)


def _eliminated(matrix: Array, row: int) -> Array:
    """One step of the elimination; the factors replace the zeros below the pivot."""
    height, width = matrix.shape
    rows = np.arange(height)
    columns = np.arange(width)
    column = matrix[:, row]
    factors = column / matrix[row, row]
    below = rows > row
    stored = jnp.where(below, factors, column)
    matrix = jnp.where(columns == row, stored[:, None], matrix)
    product = _outer_product(factors, matrix[row])
    inside = below[:, None] & (columns > row)
    return jnp.where(inside, matrix - product, matrix)


def places(
    indices: Array,
    axes: WindowAxes,
    shape: tuple[int, ...],
    sizes: Sequence[int],
    result: tuple[int, ...],
) -> tuple[Array, Array]:
    """Where elements lie in a flattened array, of which windows are read or written.

    Args:
        indices: starts of windows, shape (*batch, axes); kept inside.
        axes: of the array and of the elements.
        shape: of the array.
        sizes: of a window, along all axes.
        result: shape of the elements: batch and window axes in some order.

    Returns:
        Places, of the shape of the result, and whether a window was inside, of that
        shape with ones.
    """
    strides = _strides(shape)
    batch = indices.shape[:-1]
    first = jnp.zeros(batch, jnp.int32)
    inside = jnp.ones(batch, bool)
    for number, axis in enumerate(axes.starts):
        index = lax.index_in_dim(indices, number, -1, keepdims=False)
        given = index.astype(jnp.int32)
        largest = np.int32(shape[axis] - sizes[axis])
        kept = _clamped(0, given, largest)
        inside = inside & (given == kept)
        if largest > 0:
            first = first + kept * strides[axis]
    ones = [1] * len(result)
    for axis in axes.batch:
        ones[axis] = result[axis]
    offsets = _offsets(result, axes.matched, strides)
    return first.reshape(ones) + offsets, inside.reshape(ones)


def _strides(shape: tuple[int, ...]) -> list[np.int32]:
    """Places between neighbors along each axis; the last axis is the fastest."""
    strides = []
    for axis in range(len(shape)):
        inner = shape[axis + 1 :]
        stride = np.int32(prod(inner))
        strides.append(stride)
    return strides


def _offsets(
    result: tuple[int, ...], matched: dict[int, int], strides: Sequence[np.int32]
) -> np.ndarray:
    """Places of elements from the start of their window."""
    grid = np.indices(result, np.int32, sparse=True)
    offsets = np.zeros(result, np.int32)
    for axis, element_axis in matched.items():
        steps = grid[element_axis]
        offsets = offsets + steps * strides[axis]
    return offsets


def _plain(function: Function) -> Decomposition:
    return lambda params: function


DECOMPOSITIONS: dict[str, Decomposition] = {
    "atan2": _plain(_arc_tangent),
    "log1p": _plain(_log1p),
    "expm1": _plain(_expm1),
    "exp2": _plain(_power_of_two),
    "rsqrt": _plain(_reciprocal_root),
    "cbrt": _plain(_cube_root),
    "square": _plain(lambda x: x * x),
    "integer_pow": _power,
    "is_finite": _plain(_is_finite),
    "ne": _plain(_differs),
    "clamp": _plain(_clamped),
    "unstack": _unstacked,
    "dynamic_slice": _slice_at,
    "dynamic_update_slice": _plain(_update_at),
    "cumprod": _accumulation(jnp.multiply),
    "cummax": _accumulation(jnp.maximum),
    "cummin": _accumulation(jnp.minimum),
    "cholesky": _plain(_cholesky),
    "triangular_solve": _triangular,
    "lu": _plain(_lu),
    "lt_to": _plain(lax.lt),
    "le_to": _plain(lax.le),
}
"""By the name of the primitive: from its parameters to the function."""
