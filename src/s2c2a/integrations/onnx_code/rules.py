"""Rules of operations on elements and arrays that ONNX has."""

from collections.abc import Iterable, Sequence
from math import prod
from typing import Any

import jax.numpy as jnp
import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.integrations.jaxprs import described, other_axes, result_shape
from s2c2a.integrations.onnx_code.decompositions import chosen_case, places
from s2c2a.integrations.onnx_code.graph import (
    Operand,
    Operands,
    Shape,
    Tensor,
    element_type,
)
from s2c2a.integrations.onnx_code.writer import (
    GraphWriter,
    result_of,
    results_of,
    rule,
)
from s2c2a.integrations.windows import (
    WindowAxes,
    axes_of_gather,
    axes_of_scatter,
    sizes_of_scatter,
)

ELEMENTWISE = {
    "add": "Add",
    "add_any": "Add",
    "sub": "Sub",
    "mul": "Mul",
    "div": "Div",
    "max": "Max",
    "min": "Min",
    "neg": "Neg",
    "abs": "Abs",
    "sign": "Sign",
    "floor": "Floor",
    "ceil": "Ceil",
    "exp": "Exp",
    "log": "Log",
    "sqrt": "Sqrt",
    "sin": "Sin",
    "cos": "Cos",
    "tan": "Tan",
    "asin": "Asin",
    "acos": "Acos",
    "atan": "Atan",
    "sinh": "Sinh",
    "cosh": "Cosh",
    "tanh": "Tanh",
    "asinh": "Asinh",
    "acosh": "Acosh",
    "atanh": "Atanh",
    "erf": "Erf",
    "logistic": "Sigmoid",
    "pow": "Pow",
    "eq": "Equal",
    "lt": "Less",
    "le": "LessOrEqual",
    "gt": "Greater",
    "ge": "GreaterOrEqual",
}
LOGICAL = {"and": "And", "or": "Or", "xor": "Xor", "not": "Not"}
REDUCTIONS = {
    "reduce_sum": "ReduceSum",
    "reduce_prod": "ReduceProd",
    "reduce_max": "ReduceMax",
    "reduce_min": "ReduceMin",
    "reduce_and": "ReduceMin",
    "reduce_or": "ReduceMax",
}
EXTREMES = {"argmin": ("ArgMin", -np.inf), "argmax": ("ArgMax", np.inf)}
"""Operation, and the number that NaN counts as: JAX finds it first."""


def _node(
    writer: GraphWriter, equation: Any, operation: str, *inputs: str, **attributes: Any
) -> list[Tensor]:
    """Add a node whose output is the only result."""
    name = writer.graph.node(operation, *inputs, **attributes)
    return [result_of(equation, name)]


def _cast(writer: GraphWriter, name: str, dtype: Any) -> str:
    """Add a conversion of elements."""
    return writer.graph.node("Cast", name, to=element_type(dtype))


def _whole(writer: GraphWriter, operand: Operand) -> Tensor:
    """The operand in the graph with all its elements."""
    name = writer.full(operand)
    return Tensor(name, operand.dtype, operand.shape, operand.shape)


@rule(*ELEMENTWISE)
def _elementwise(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    operation = ELEMENTWISE[equation.primitive.name]
    return [writer.elementwise(operation, equation, operands)]


@rule(*LOGICAL)
def _logical(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    operation = LOGICAL[equation.primitive.name]
    if operands[0].dtype != bool:
        operation = f"Bitwise{operation}"
    return [writer.elementwise(operation, equation, operands)]


@rule("rem")
def _remainder(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    # the sign is that of the dividend, as in JAX
    names = map(writer.full, operands)
    return _node(writer, equation, "Mod", *names, fmod=1)


@rule("round")
def _rounded(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    method = str(equation.params["rounding_method"])
    if "EVEN" in method:
        return [writer.elementwise("Round", equation, operands)]
    return writer.traced(_away_from_zero, *operands)


def _away_from_zero(x: Any) -> Any:
    size = jnp.abs(x)
    rounded = jnp.floor(size + 0.5)
    return jnp.sign(x) * rounded


@rule("convert_element_type")
def _converted(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    value = writer.value(operands[0])
    result = described(equation.outvars[0])
    if value.dtype == result.dtype:
        return [value]
    name = _cast(writer, value.name, result.dtype)
    return [Tensor(name, np.dtype(result.dtype), value.shape, value.held)]


@rule("select_n")
def _select(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    which, *cases = operands
    if which.dtype != bool:
        return writer.traced(chosen_case, *operands)
    other, chosen = cases
    return [writer.elementwise("Where", equation, [which, chosen, other])]


@rule("broadcast_in_dim", "expand_dims")
def _broadcast(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    shape = result_shape(equation)
    value = writer.value(operands[0])
    params = equation.params
    new = params.get("dimensions", ())
    kept = other_axes(len(shape), new)
    axes = params.get("broadcast_dimensions", kept)
    sizes = [1] * len(shape)
    for axis, size in zip(axes, value.padded, strict=True):
        sizes[axis] = size
    held = _without_leading_ones(sizes)
    return [writer.reshaped(value, shape, held)]


def _without_leading_ones(sizes: Sequence[int]) -> Shape:
    """The sizes from the first that is not one."""
    held = tuple(sizes)
    while held and held[0] == 1:
        held = held[1:]
    return held


@rule("squeeze", "reshape")
def _reshape(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    shape = result_shape(equation)
    value = writer.value(operands[0])
    if not value.held:
        return [writer.reshaped(value, shape, ())]
    if equation.primitive.name == "squeeze":
        dropped = equation.params["dimensions"]
        kept = other_axes(len(value.shape), dropped)
        held = tuple(value.padded[axis] for axis in kept)
        return [writer.reshaped(value, shape, held)]
    whole = _whole(writer, value)
    return [writer.reshaped(whole, shape, shape)]


@rule("transpose")
def _transpose(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    shape = result_shape(equation)
    value = writer.value(operands[0])
    if not value.held:
        return [writer.reshaped(value, shape, ())]
    order = list(map(int, equation.params["permutation"]))
    padded = writer.reshaped(value, value.shape, value.padded)
    held = tuple(padded.held[axis] for axis in order)
    name = writer.graph.node("Transpose", padded.name, perm=order)
    return [Tensor(name, value.dtype, shape, held)]


Range = tuple[int, int, int]
"""Start, end and step of a part along an axis."""


@rule("slice")
def _slice(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    params = equation.params
    value = operands[0]
    starts = params["start_indices"]
    ends = params["limit_indices"]
    steps = params["strides"] or (1,) * len(starts)
    parts = {}
    for axis, part in enumerate(zip(starts, ends, steps, strict=True)):
        everything = (0, value.shape[axis], 1)
        if part != everything:
            parts[axis] = part
    return [_sliced(writer, equation, value, parts)]


@rule("rev")
def _reverse(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    before_first = np.iinfo(np.int64).min
    backward = (-1, before_first, -1)
    axes = equation.params["dimensions"]
    parts = dict.fromkeys(axes, backward)
    return [_sliced(writer, equation, operands[0], parts)]


def _sliced(
    writer: GraphWriter, equation: Any, operand: Operand, parts: dict[int, Range]
) -> Tensor:
    """Parts along some axes, by the axis."""
    shape = result_shape(equation)
    value = writer.value(operand)
    missing = len(shape) - len(value.held)
    held = list(value.held)
    ranges = {}
    for axis, part in parts.items():
        held_axis = axis - missing
        if held_axis >= 0 and held[held_axis] > 1:
            ranges[held_axis] = part
            held[held_axis] = shape[axis]
    if not ranges:
        return Tensor(value.name, value.dtype, shape, value.held)
    name = _slice_node(writer, value.name, ranges)
    return Tensor(name, value.dtype, shape, tuple(held))


def _slice_node(writer: GraphWriter, name: str, ranges: dict[int, Range]) -> str:
    graph = writer.graph
    starts, ends, steps = zip(*ranges.values(), strict=True)
    inputs = [
        graph.integers(*starts),
        graph.integers(*ends),
        graph.integers(*ranges),
        graph.integers(*steps),
    ]
    return graph.node("Slice", name, *inputs)


@rule("split")
def _split(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    sizes = equation.params["sizes"]
    axis = int(equation.params["axis"])
    name = writer.full(operands[0])
    lengths = writer.graph.integers(*sizes)
    parts = writer.graph.nodes_of("Split", [name, lengths], len(sizes), axis=axis)
    return results_of(equation, parts)


@rule("concatenate")
def _concatenate(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    axis = int(equation.params["dimension"])
    names = [writer.full(operand) for operand in operands if operand.size]
    return _node(writer, equation, "Concat", *names, axis=axis)


@rule("stack")
def _stack(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    axis = int(equation.params["axis"])
    at = writer.graph.integers(axis)
    rows = []
    for operand in operands:
        name = writer.full(operand)
        row = writer.graph.node("Unsqueeze", name, at)
        rows.append(row)
    return _node(writer, equation, "Concat", *rows, axis=axis)


@rule("pad")
def _pad(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    config = equation.params["padding_config"]
    if any(between for _, _, between in config):
        return _spread(writer, equation, operands)
    lows = [low for low, _, _ in config]
    highs = [high for _, high, _ in config]
    value, filling = map(writer.full, operands)
    ends = writer.graph.integers(*lows, *highs)
    return _node(writer, equation, "Pad", value, ends, filling)


def _spread(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    """Padding between elements."""
    config = equation.params["padding_config"]
    sizes = operands[0].shape
    shape = result_shape(equation)
    rows = []
    for (low, high, between), size in zip(config, sizes, strict=True):
        if low < 0 or high < 0:
            raise S2C2AError(
                "negative padding between elements cannot be exported to ONNX"
            )
        row = low + (1 + between) * np.arange(size)
        rows.append(row)

    def padded(value: Any, filling: Any) -> Any:
        everywhere = jnp.full(shape, filling)
        grid = np.ix_(*rows)
        return everywhere.at[grid].set(value)

    return writer.traced(padded, *operands)


@rule("tile")
def _tile(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    shape = result_shape(equation)
    value = _whole(writer, operands[0])
    new = len(shape) - len(value.shape)
    sizes = (1,) * new + tuple(value.shape)
    aligned = writer.reshaped(value, sizes, sizes)
    counts = [total // size for total, size in zip(shape, sizes, strict=True)]
    repeats = writer.graph.integers(*counts)
    return _node(writer, equation, "Tile", aligned.name, repeats)


@rule("iota")
def _iota(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    # only large ones are not known already
    aval = described(equation.outvars[0])
    axis = equation.params["dimension"]
    grid = np.indices(aval.shape, aval.dtype, sparse=True)
    numbers = np.broadcast_to(grid[axis], aval.shape)
    return [np.array(numbers)]


@rule(*REDUCTIONS)
def _reduce(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    axes = list(map(int, equation.params["axes"]))
    value = operands[0]
    if all(value.shape[axis] == 1 for axis in axes):
        return writer.traced(lambda x: jnp.squeeze(x, axes), value)
    operation = REDUCTIONS[equation.primitive.name]
    name = _reduced(writer, operation, value, axes)
    result = result_of(equation, name)
    if value.dtype.kind != "f" or operation not in ("ReduceMax", "ReduceMin"):
        return [result]

    def with_nan(found: Any, values: Any) -> Any:
        is_nan = values != values
        return jnp.where(is_nan.any(axes), np.nan, found)

    return writer.traced(with_nan, result, value)  # ONNX Runtime skips NaN


def _reduced(
    writer: GraphWriter, operation: str, value: Operand, axes: Sequence[int]
) -> str:
    """Add a reduction; truth values are reduced as integers."""
    is_bool = value.dtype == bool
    name = writer.full(value)
    if is_bool:
        name = _cast(writer, name, np.int32)
    at = writer.graph.integers(*axes)
    name = writer.graph.node(operation, name, at, keepdims=0)
    if is_bool:
        name = _cast(writer, name, np.bool_)
    return name


@rule(*EXTREMES)
def _extreme_index(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    operation, found = EXTREMES[equation.primitive.name]
    value = operands[0]
    axis = int(equation.params["axes"][0])
    if value.dtype.kind == "f":
        (value,) = writer.traced(lambda x: jnp.where(x != x, found, x), value)
    name = writer.full(value)
    index = writer.graph.node(operation, name, axis=axis, keepdims=0)
    dtype = described(equation.outvars[0]).dtype
    converted = _cast(writer, index, dtype)
    return [result_of(equation, converted)]


@rule("cumsum")
def _accumulate(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    params = equation.params
    number = np.array(params["axis"], np.int64)
    axis = writer.graph.constant(number)
    is_turned = int(params["reverse"])
    name = writer.full(operands[0])
    return _node(writer, equation, "CumSum", name, axis, reverse=is_turned)


@rule("sort")
def _sort(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    params = equation.params
    axis = int(params["dimension"])
    if params["num_keys"] != 1:
        raise S2C2AError("a sort by several keys cannot be exported to ONNX")
    keys, *others = operands
    count = keys.shape[axis]
    values, order = _first_ones(writer, keys, count, axis, largest=0)
    names = [values]
    for operand in others:
        array = writer.full(operand)
        ordered = writer.graph.node("GatherElements", array, order, axis=axis)
        names.append(ordered)
    return results_of(equation, names)


@rule("top_k")
def _top(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    axis = int(equation.params["axis"])
    count = result_shape(equation)[axis]
    values, order = _first_ones(writer, operands[0], count, axis, largest=1)
    indices = _cast(writer, order, np.int32)
    return results_of(equation, [values, indices])


def _first_ones(
    writer: GraphWriter, keys: Operand, count: int, axis: int, largest: int
) -> list[str]:
    """Values and indices of the largest or smallest; equal ones stay in their order."""
    name = writer.full(keys)
    number = writer.graph.integers(count)
    return writer.graph.nodes_of(
        "TopK", [name, number], 2, axis=axis, largest=largest, sorted=1
    )


@rule("dot_general")
def _dot(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    """Axes in the order of `MatMul`: batch, rows, columns."""
    contracted, batch = equation.params["dimension_numbers"]
    left, right = operands
    lefts = other_axes(len(left.shape), (*contracted[0], *batch[0]))
    rights = other_axes(len(right.shape), (*contracted[1], *batch[1]))
    shared = _sizes(left, batch[0])
    rows = _size(left, lefts)
    columns = _size(right, rights)
    length = _size(left, contracted[0])
    left_order = [*batch[0], *lefts, *contracted[0]]
    right_order = [*batch[1], *contracted[1], *rights]
    first = _ordered(writer, left, left_order, [*shared, rows, length])
    second = _ordered(writer, right, right_order, [*shared, length, columns])
    product = writer.graph.node("MatMul", first, second)
    shape = writer.graph.integers(*result_shape(equation))
    return _node(writer, equation, "Reshape", product, shape)


def _sizes(operand: Operand, axes: Iterable[int]) -> list[int]:
    return [operand.shape[axis] for axis in axes]


def _size(operand: Operand, axes: Iterable[int]) -> int:
    """Number of elements along some axes."""
    sizes = _sizes(operand, axes)
    return prod(sizes)


def _ordered(
    writer: GraphWriter, operand: Operand, order: Iterable[int], shape: list[int]
) -> str:
    """Add the operand with its axes in another order, then in another shape."""
    name = writer.full(operand)
    axes = list(map(int, order))
    if axes != sorted(axes):
        name = writer.graph.node("Transpose", name, perm=axes)
    if _sizes(operand, axes) == shape:
        return name
    sizes = writer.graph.integers(*shape)
    return writer.graph.node("Reshape", name, sizes)


@rule("gather")
def _gather(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    params = equation.params
    array, indices = operands
    axes = axes_of_gather(equation)
    sizes = params["slice_sizes"]
    shape = result_shape(equation)
    at, inside = _places(writer, array, indices, axes, sizes, shape)
    flat = _flat(writer, array)
    found = writer.graph.node("Gather", flat, writer.full(at))
    result = result_of(equation, found)
    if "FILL" not in str(params["mode"]) or _is_true(inside):
        return [result]
    filling = _filling(params["fill_value"], array.dtype)

    def filled(elements: Any, is_inside: Any) -> Any:
        return jnp.where(is_inside, elements, filling)

    return writer.traced(filled, result, inside)


def _places(
    writer: GraphWriter,
    array: Operand,
    indices: Operand,
    axes: WindowAxes,
    sizes: Sequence[int],
    elements: Shape,
) -> Operands:
    """Where the elements of windows lie, and which windows are inside."""

    def of(starts: Any) -> Any:
        return places(starts, axes, array.shape, sizes, elements)

    return writer.traced(of, indices)


def _filling(value: Any, dtype: np.dtype) -> Any:
    if value is not None:
        return np.asarray(value, dtype)
    if dtype.kind == "f":
        return np.asarray(np.nan, dtype)
    smallest = np.iinfo(dtype).min
    return np.asarray(smallest, dtype)


SCATTERED = {
    "scatter": "none",
    "scatter-add": "add",
    "scatter_add": "add",
    "scatter-mul": "mul",
    "scatter_mul": "mul",
}


@rule(*SCATTERED)
def _scatter(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    array, indices, updates = operands
    axes = axes_of_scatter(equation)
    sizes = sizes_of_scatter(equation, axes)
    at, inside = _places(writer, array, indices, axes, sizes, updates.shape)
    test: Operand | None = inside
    is_clipped = "CLIP" in str(equation.params["mode"])
    if is_clipped or _is_true(inside):
        test = None
    reduction = SCATTERED[equation.primitive.name]
    flat = _scattered(writer, array, updates, at, test, reduction)
    shape = writer.graph.integers(*array.shape)
    return _node(writer, equation, "Reshape", flat, shape)


def _scattered(
    writer: GraphWriter,
    array: Operand,
    updates: Operand,
    at: Operand,
    inside: Operand | None,
    reduction: str,
) -> str:
    """Flat array; updates that are not inside go to an element behind its end."""
    graph = writer.graph
    flat = _flat(writer, array)
    if inside is not None:
        (at,) = writer.traced(_or_behind(array.size), at, inside)
        one_behind = graph.integers(0, 1)
        flat = graph.node("Pad", flat, one_behind)
    inputs = [flat, _flat(writer, at), _flat(writer, updates)]
    name = graph.node("ScatterElements", *inputs, axis=0, reduction=reduction)
    if inside is None:
        return name
    start = graph.integers(0)
    end = graph.integers(array.size)
    return graph.node("Slice", name, start, end)


def _or_behind(size: int) -> Any:
    """Function of places and tests: the place, or the one behind the end."""
    behind = np.int32(size)
    return lambda place, test: jnp.where(test, place, behind)


def _flat(writer: GraphWriter, operand: Operand) -> str:
    name = writer.full(operand)
    if len(operand.shape) == 1:
        return name
    shape = writer.graph.integers(-1)
    return writer.graph.node("Reshape", name, shape)


def _is_true(operand: Operand) -> bool:
    if not isinstance(operand, np.ndarray):
        return False
    return bool(operand.all())
