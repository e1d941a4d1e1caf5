"""Rules of operations that move, reduce or combine whole arrays."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import prod
from typing import Any, TypeVar

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.elementwise import (
    ACCUMULATIONS,
    REDUCTIONS,
    combined,
    start_of_reduction,
)
from s2c2a.integrations.c_code.jaxprs import other_axes, result_shape
from s2c2a.integrations.c_code.program import index_names, kind_of, literal, looped
from s2c2a.integrations.c_code.values import (
    Computed,
    Indices,
    Kind,
    Place,
    Shape,
    Stored,
    Value,
    contiguous_strides,
)
from s2c2a.integrations.c_code.writer import Writer, broadcast_at, rule

Values = Sequence[Value]
Item = TypeVar("Item")


def output_of(equation: Any, number: int = 0) -> tuple[Kind, Shape]:
    """Type and shape of a result."""
    aval = equation.outvars[number].aval
    return kind_of(aval.dtype), tuple(aval.shape)


def new_result(writer: Writer, equation: Any, number: int = 0) -> Stored:
    """A new array for a result."""
    kind, shape = output_of(equation, number)
    return writer.program.new_array(kind, shape)


def add_loops(writer: Writer, shape: Shape, indices: Indices, statement: str) -> None:
    """Add a statement in loops over all elements."""
    loops = looped(shape, indices, statement)
    writer.program.add(loops)


def block(statements: Iterable[str]) -> str:
    """Statements as one."""
    content = " ".join(statements)
    return f"{{ {content} }}"


def places_of(values: Values) -> frozenset[Place]:
    """Parts of the workspace that values read."""
    return frozenset().union(*(value.places for value in values))


def cheap(writer: Writer, value: Value) -> Value:
    """A value that costs nothing to read again and again."""
    return writer.program.stored(value) if value.cost else value


def _picked(items: Sequence[Item], axes: Iterable[int]) -> tuple[Item, ...]:
    """Sizes or indices along some axes."""
    return tuple(items[axis] for axis in axes)


def _across(items: tuple[Item, ...], axis: int) -> tuple[Item, ...]:
    """Sizes or indices along all other axes."""
    return items[:axis] + items[axis + 1 :]


def _inserted(others: Indices, axis: int, index: str) -> Indices:
    """Indices with one along a further axis."""
    return (*others[:axis], index, *others[axis:])


@rule("broadcast_in_dim")
def _broadcast(writer: Writer, equation: Any, values: Values) -> Values:
    shape = result_shape(equation)
    value = values[0]
    if prod(shape) > prod(value.shape):
        value = cheap(writer, value)
    axes = equation.params.get("broadcast_dimensions", ())
    return [value.broadcast(shape, axes)]


@rule("squeeze")
def _squeeze(writer: Writer, equation: Any, values: Values) -> Values:
    dropped = equation.params["dimensions"]
    return [values[0].without(dropped)]


@rule("transpose")
def _transpose(writer: Writer, equation: Any, values: Values) -> Values:
    order = equation.params["permutation"]
    return [values[0].permuted(order)]


@rule("slice")
def _slice(writer: Writer, equation: Any, values: Values) -> Values:
    shape = result_shape(equation)
    params = equation.params
    starts = params["start_indices"]
    steps = params["strides"] or (1,) * len(shape)
    return [values[0].sliced(starts, shape, steps)]


@rule("rev")
def _reverse(writer: Writer, equation: Any, values: Values) -> Values:
    axes = equation.params["dimensions"]
    return [_backward(values[0], axes)]


def _backward(value: Any, axes: Iterable[int]) -> Any:
    """An array with the opposite order along some axes."""
    shape = value.shape
    starts = [0] * len(shape)
    steps = [1] * len(shape)
    for axis in axes:
        starts[axis] = shape[axis] - 1
        steps[axis] = -1
    return value.sliced(starts, shape, steps)


@rule("split", "unstack")
def _split(writer: Writer, equation: Any, values: Values) -> Values:
    axis = equation.params["axis"]
    value = cheap(writer, values[0])
    is_split = equation.primitive.name == "split"
    sizes = equation.params["sizes"] if is_split else [1] * value.shape[axis]
    parts: list[Value] = []
    start = 0
    for size in map(int, sizes):
        part = _along(value, axis, start, size)
        parts.append(part if is_split else part.without((axis,)))
        start += size
    return parts


@rule("reshape")
def _reshape(writer: Writer, equation: Any, values: Values) -> Values:
    shape = result_shape(equation)
    value = values[0]
    ones = _axes_of_one(value.shape)
    kept = other_axes(len(value.shape), ones)
    new = other_axes(len(shape), _axes_of_one(shape))
    if _picked(value.shape, kept) == _picked(shape, new):
        needed = value.without(ones)
        return [needed.broadcast(shape, new)]
    array = writer.program.contiguous(value)
    strides = contiguous_strides(shape)
    return [replace(array, shape=shape, strides=strides)]


def _axes_of_one(shape: Shape) -> list[int]:
    """Axes that have one element."""
    return [axis for axis, size in enumerate(shape) if size == 1]


@rule("tile")
def _tile(writer: Writer, equation: Any, values: Values) -> Values:
    kind, shape = output_of(equation)
    value = writer.program.stored(values[0])
    new = len(shape) - len(value.shape)

    def at(indices: Indices) -> str:
        # repeats may add axes in front
        inside = []
        for index, size in zip(indices[new:], value.shape, strict=True):
            inside.append(f"({index} % {size})")
        return value.at(tuple(inside))

    return [Computed(kind, shape, at, cost=1, places=value.places)]


@rule("select_n")
def _select(writer: Writer, equation: Any, values: Values) -> Values:
    kind, shape = output_of(equation)
    which, *cases = values

    def at(indices: Indices) -> str:
        chosen = broadcast_at(which, indices)
        texts = [broadcast_at(case, indices) for case in cases]
        *others, text = texts
        is_test = len(texts) == 2
        for number, case in reversed(list(enumerate(others))):
            test = chosen if is_test else f"{chosen} > {number}"
            text = f"({test} ? {text} : {case})"
        return text

    cost = 1 + sum(value.cost for value in values)
    return [Computed(kind, shape, at, cost=cost, places=places_of(values))]


@rule("iota")
def _iota(writer: Writer, equation: Any, values: Values) -> Values:
    kind, shape = output_of(equation)
    axis = equation.params["dimension"]

    def at(indices: Indices) -> str:
        index = indices[axis]
        return f"(({kind}){index})"

    return [Computed(kind, shape, at)]


@rule("concatenate", "stack")
def _concatenate(writer: Writer, equation: Any, values: Values) -> Values:
    is_stack = equation.primitive.name == "stack"
    axis = equation.params["axis" if is_stack else "dimension"]
    result = new_result(writer, equation)
    start = 0
    for value in values:
        size = 1 if is_stack else value.shape[axis]
        target = _along(result, axis, start, size)
        writer.program.assign(target.without((axis,)) if is_stack else target, value)
        start += size
    return [result]


@rule("pad")
def _pad(writer: Writer, equation: Any, values: Values) -> Values:
    value, filling = values
    starts = []
    steps = []
    for low, high, interior in equation.params["padding_config"]:
        if low < 0 or high < 0:
            raise S2C2AError("negative padding cannot be exported to C")
        starts.append(int(low))
        steps.append(1 + interior)
    result = new_result(writer, equation)
    everywhere = filling.broadcast(result.shape, ())
    writer.program.assign(result, everywhere)
    target = result.sliced(starts, value.shape, steps)
    writer.program.assign(target, value)
    return [result]


@rule(*REDUCTIONS)
def _reduce(writer: Writer, equation: Any, values: Values) -> Values:
    axes = equation.params["axes"]
    if not axes:
        return values
    name = equation.primitive.name
    value = values[0]
    result = new_result(writer, equation)
    kind = result.kind
    outer = index_names(result.shape)
    inner = index_names(value.shape, "r")
    # the inner indices along some axes, the outer ones along all others
    indices = list(inner)
    kept = other_axes(len(inner), axes)
    for axis, index in zip(kept, outer, strict=True):
        indices[axis] = index
    source = tuple(indices)
    element = value.at(source)
    total = combined(REDUCTIONS[name][0], kind, "s", element)
    sizes = _picked(value.shape, axes)
    loops = _picked(inner, axes)
    start = start_of_reduction(name, kind)
    statements = [
        f"{kind} s = {start};",
        looped(sizes, loops, f"s = {total};"),
        f"{result.at(outer)} = s;",
    ]
    add_loops(writer, result.shape, outer, block(statements))
    return [result]


@rule("argmin", "argmax")
def _extreme_index(writer: Writer, equation: Any, values: Values) -> Values:
    (axis,) = equation.params["axes"]
    value = values[0]
    result = new_result(writer, equation)
    outer = index_names(result.shape)
    first = value.at(_inserted(outer, axis, "0"))
    other = value.at(_inserted(outer, axis, "r"))
    length = value.shape[axis]
    is_smallest = equation.primitive.name == "argmin"
    sign = "<" if is_smallest else ">"
    is_better = f"v {sign} best || (v != v && best == best)"
    statements = [
        f"{value.kind} best = {first};",
        f"{result.kind} at = 0;",
        f"for (int r = 1; r < {length}; r++) {{",
        f"{value.kind} v = {other};",
        f"if ({is_better}) {{ best = v; at = r; }}",
        "}",
        f"{result.at(outer)} = at;",
    ]
    add_loops(writer, result.shape, outer, block(statements))
    return [result]


@rule(*ACCUMULATIONS)
def _accumulate(writer: Writer, equation: Any, values: Values) -> Values:
    axis = equation.params["axis"]
    result = new_result(writer, equation)
    writer.program.assign(result, values[0])
    is_turned = equation.params.get("reverse", False)
    ordered = _backward(result, [axis]) if is_turned else result
    names = index_names(result.shape)
    others = _across(names, axis)
    here = ordered.at(_inserted(others, axis, "r"))
    last = ordered.at(_inserted(others, axis, "(r - 1)"))
    operation = ACCUMULATIONS[equation.primitive.name]
    total = combined(operation, result.kind, last, here)
    length = result.shape[axis]
    loop = f"for (int r = 1; r < {length}; r++) {here} = {total};"
    rest = _across(result.shape, axis)
    add_loops(writer, rest, others, loop)
    return [result]


@rule("dynamic_slice")
def _dynamic_slice(writer: Writer, equation: Any, values: Values) -> Values:
    shape = result_shape(equation)
    operand, *starts = values
    value = writer.program.stored(operand)
    return [_moved(writer, value, shape, starts)]


@rule("dynamic_update_slice")
def _dynamic_update(writer: Writer, equation: Any, values: Values) -> Values:
    value, update, *starts = values
    result = new_result(writer, equation)
    writer.program.assign(result, value)
    target = _moved(writer, result, update.shape, starts)
    writer.program.assign(target, update)
    return [result]


def _moved(writer: Writer, value: Stored, shape: Shape, starts: Values) -> Stored:
    """View of a part whose start is known when the program runs."""
    offset = value.offset
    places = value.places
    for start, stride, size, part in zip(
        starts, value.strides, value.shape, shape, strict=True
    ):
        if size == part or not stride:
            continue
        index = writer.program.new_array("int32_t", ())
        first = index.at(())
        kept = clamped(start.at(()), size - part)
        writer.program.add(f"{first} = {kept};")
        offset = f"{offset} + {first} * {stride}"
        places = places | index.places
    return replace(value, shape=shape, offset=offset, places=places)


def clamped(index: str, largest: int) -> str:
    """C expression of an index that is kept inside."""
    return f"s_imin(s_imax({index}, 0), {largest})"


def _along(value: Any, axis: int, start: int, size: int) -> Any:
    """A part of an array along one axis."""
    shape = list(value.shape)
    shape[axis] = size
    starts = [0] * len(shape)
    starts[axis] = start
    steps = [1] * len(shape)
    return value.sliced(starts, tuple(shape), steps)


@rule("gather")
def _gather(writer: Writer, equation: Any, values: Values) -> Values:
    params = equation.params
    numbers = params["dimension_numbers"]
    result = new_result(writer, equation)
    place, inside = _window_element(
        writer.program.stored(values[0]),
        writer.program.stored(values[1]),
        result.shape,
        numbers.start_index_map,
        numbers.collapsed_slice_dims,
        numbers.offset_dims,
        numbers.operand_batching_dims,
        numbers.start_indices_batching_dims,
    )
    names = index_names(result.shape)
    if "FILL" in str(params["mode"]):
        filling = "NAN" if result.kind == "float" else "INT32_MIN"
        if params["fill_value"] is not None:
            filling = literal(params["fill_value"])
        place = f"{inside} ? {place} : {filling}"
    add_loops(writer, result.shape, names, f"{result.at(names)} = {place};")
    return [result]


@rule("scatter", "scatter-add", "scatter_add", "scatter-mul", "scatter_mul")
def _scatter(writer: Writer, equation: Any, values: Values) -> Values:
    numbers = equation.params["dimension_numbers"]
    indices = writer.program.stored(values[1])
    updates = writer.program.stored(values[2])
    result = new_result(writer, equation)
    writer.program.assign(result, values[0])
    place, inside = _window_element(
        result,
        indices,
        updates.shape,
        numbers.scatter_dims_to_operand_dims,
        numbers.inserted_window_dims,
        numbers.update_window_dims,
        numbers.operand_batching_dims,
        numbers.scatter_indices_batching_dims,
    )
    names = index_names(updates.shape)
    value = updates.at(names)
    operation = equation.primitive.name[-3:]
    if operation in ("add", "mul"):
        value = combined(operation, result.kind, place, value)
    add_loops(writer, updates.shape, names, f"if ({inside}) {place} = {value};")
    return [result]


def _window_element(
    array: Stored,
    indices: Stored,
    shape: Shape,
    starts: Sequence[int],
    dropped: Sequence[int],
    inside: Sequence[int],
    array_batches: Sequence[int],
    index_batches: Sequence[int],
) -> tuple[str, str]:
    """C expressions of an element in a window of an array, and of a test.

    Args:
        array: that is read or written.
        indices: where the windows start.
        shape: of the elements of all windows.
        starts: axes of the array that starts count along.
        dropped: axes of the array that windows lack, beside batches.
        inside: axes of the elements that are within a window.
        array_batches: axes along which the array has a part of its own for each index.
        index_batches: the same axes among those of the indices.

    Returns:
        The element, its window kept inside the array, and whether it was inside.
    """
    names = index_names(shape)
    batch = other_axes(len(shape), inside)
    kept = other_axes(len(array.shape), (*dropped, *array_batches))
    places = ["0"] * len(array.shape)
    sizes = [1] * len(array.shape)
    for axis, element_axis in zip(kept, inside, strict=True):
        places[axis] = names[element_axis]
        sizes[axis] = shape[element_axis]
    for axis, index_axis in zip(array_batches, index_batches, strict=True):
        places[axis] = names[batch[index_axis]]
    tests = []
    for number, axis in enumerate(starts):
        index = indices.at((*_picked(names, batch), str(number)))
        largest = array.shape[axis] - sizes[axis]
        start = clamped(index, largest)
        is_first = places[axis] == "0"
        places[axis] = start if is_first else f"({start} + {places[axis]})"
        tests.append(f"({index} >= 0 && {index} <= {largest})")
    return array.at(tuple(places)), " && ".join(tests) or "1"


@rule("sort", "top_k")
def _sort(writer: Writer, equation: Any, values: Values) -> Values:
    """Stable insertion sort of one axis: rows are short."""
    params = equation.params
    is_top = equation.primitive.name == "top_k"
    if not is_top and params["num_keys"] != 1:
        raise S2C2AError("a sort by several keys cannot be exported to C")
    axis = params["axis"] if is_top and "axis" in params else params["dimension"]
    arrays = [writer.program.stored(value) for value in values]
    keys = arrays[0]
    length = keys.shape[axis]
    order = writer.program.new_array("int32_t", (length,))
    outputs = range(len(equation.outvars))
    results = [new_result(writer, equation, number) for number in outputs]
    others = _across(keys.shape, axis)
    outer = index_names(others)

    def at(array: Stored, index: str) -> str:
        return array.at(_inserted(outer, axis, index))

    here = order.at(("j",))
    previous = order.at(("(j - 1)",))
    smaller = at(keys, "c")
    larger = at(keys, previous)
    if is_top:
        smaller, larger = larger, smaller
    is_less = f"{smaller} < {larger}"
    if keys.kind == "float":
        is_less = f"s_less({smaller}, {larger})"
    statements = [
        f"for (int c = 0; c < {length}; c++) {{",
        "int j = c;",
        f"for (; j > 0 && {is_less}; j--) {here} = {previous};",
        f"{here} = c;",
        "}",
        f"for (int r = 0; r < {results[0].shape[axis]}; r++) {{",
    ]
    place = order.at(("r",))
    for number, result in enumerate(results):
        # a further result is the order
        source = at(arrays[number], place) if number < len(arrays) else place
        statements.append(f"{at(result, 'r')} = {source};")
    statements.append("}")
    add_loops(writer, others, outer, block(statements))
    return results
