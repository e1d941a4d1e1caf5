"""Rules of operations that move, reduce or combine whole arrays."""

from collections.abc import Sequence
from math import prod
from typing import Any

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.elementwise import (
    ACCUMULATIONS,
    REDUCTIONS,
    combined,
    start_of_reduction,
)
from s2c2a.integrations.c_code.program import index_names, kind_of, literal, looped
from s2c2a.integrations.c_code.values import (
    Computed,
    Indices,
    Kind,
    Shape,
    Stored,
    Value,
)
from s2c2a.integrations.c_code.writer import Writer, broadcast_at, described, rule


def output_of(equation: Any, number: int = 0) -> tuple[Kind, Shape]:
    """Type and shape of a result."""
    aval = described(equation.outvars[number])
    return kind_of(aval.dtype), tuple(aval.shape)


@rule("broadcast_in_dim")
def _broadcast(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    value = values[0]
    if value.cost and prod(shape) > prod(value.shape):
        value = writer.stored(value)
    axes = equation.params.get("broadcast_dimensions", ())
    return [value.broadcast(shape, axes)]


@rule("squeeze")
def _squeeze(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    return [values[0].without(equation.params["dimensions"])]


@rule("expand_dims")
def _expand(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    new = equation.params["dimensions"]
    axes = [axis for axis in range(len(shape)) if axis not in new]
    return [values[0].broadcast(shape, axes)]


@rule("transpose")
def _transpose(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    return [values[0].permuted(equation.params["permutation"])]


@rule("slice")
def _slice(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    params = equation.params
    steps = params["strides"] or (1,) * len(shape)
    return [values[0].sliced(params["start_indices"], shape, steps)]


@rule("rev")
def _reverse(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    shape = values[0].shape
    turned = equation.params["dimensions"]
    starts = [shape[axis] - 1 if axis in turned else 0 for axis in range(len(shape))]
    steps = [-1 if axis in turned else 1 for axis in range(len(shape))]
    return [values[0].sliced(starts, shape, steps)]


@rule("split")
def _split(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    axis = equation.params["axis"]
    value = writer.stored(values[0]) if values[0].cost else values[0]
    parts: list[Value] = []
    start = 0
    for size in equation.params["sizes"]:
        parts.append(_along(value, axis, start, int(size)))
        start += int(size)
    return parts


@rule("unstack")
def _unstack(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    axis = equation.params["axis"]
    value = writer.stored(values[0]) if values[0].cost else values[0]
    count = value.shape[axis]
    return [_along(value, axis, row, 1).without((axis,)) for row in range(count)]


@rule("reshape")
def _reshape(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    _, shape = output_of(equation)
    value = values[0]
    kept = [axis for axis, size in enumerate(value.shape) if size != 1]
    new = [axis for axis, size in enumerate(shape) if size != 1]
    if [value.shape[axis] for axis in kept] == [shape[axis] for axis in new]:
        ones = [axis for axis, size in enumerate(value.shape) if size == 1]
        return [value.without(ones).broadcast(shape, new)]
    array = writer.program.contiguous(value)
    return [
        Stored.contiguous(array.kind, shape, array.base, array.offset, array.places)
    ]


@rule("tile")
def _tile(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    value = writer.stored(values[0])
    rank = len(value.shape)

    def at(indices: Indices) -> str:
        # repeats may add axes in front
        pairs = zip(indices[len(shape) - rank :], value.shape, strict=True)
        return value.at(tuple(f"({index} % {size})" for index, size in pairs))

    return [Computed(kind, shape, at, 1, value.places)]


@rule("select_n")
def _select(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    which, *cases = values

    def at(indices: Indices) -> str:
        texts = [broadcast_at(case, indices) for case in cases]
        chosen = broadcast_at(which, indices)
        text = texts[-1]
        for number in reversed(range(len(texts) - 1)):
            test = chosen if len(texts) == 2 else f"{chosen} > {number}"
            text = f"({test} ? {text} : {texts[number]})"
        return text

    places = frozenset().union(*(value.places for value in values))
    cost = 1 + sum(value.cost for value in values)
    return [Computed(kind, shape, at, cost, places)]


@rule("iota")
def _iota(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    axis = equation.params["dimension"]
    return [Computed(kind, shape, lambda to: f"(({kind}){to[axis]})")]


@rule("concatenate", "stack")
def _concatenate(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    is_stack = equation.primitive.name == "stack"
    axis = equation.params["axis" if is_stack else "dimension"]
    result = writer.program.new_array(kind, shape)
    start = 0
    for value in values:
        size = 1 if is_stack else value.shape[axis]
        target = _along(result, axis, start, size)
        target = target.without((axis,)) if is_stack else target
        writer.program.assign(target, value)
        start += size
    return [result]


@rule("pad")
def _pad(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    value, filling = values
    config = equation.params["padding_config"]
    if any(low < 0 or high < 0 for low, high, _ in config):
        raise S2C2AError("negative padding cannot be exported to C")
    result = writer.program.new_array(kind, shape)
    writer.program.assign(result, filling.broadcast(shape, ()))
    starts = [int(low) for low, _, _ in config]
    steps = [1 + interior for _, _, interior in config]
    writer.program.assign(result.sliced(starts, value.shape, steps), value)
    return [result]


@rule(*REDUCTIONS)
def _reduce(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    axes = equation.params["axes"]
    if not axes:
        return values
    kind, shape = output_of(equation)
    name = equation.primitive.name
    result = writer.program.new_array(kind, shape)
    outer = index_names(shape)
    kept = iter(outer)
    inner = index_names(values[0].shape, "r")
    source = tuple(
        inner[axis] if axis in axes else next(kept)
        for axis in range(len(values[0].shape))
    )
    sizes = tuple(values[0].shape[axis] for axis in axes)
    loops = tuple(inner[axis] for axis in axes)
    start = start_of_reduction(name, kind)
    element = values[0].at(source)
    total = combined(REDUCTIONS[name], kind, "s", element)
    summed = looped(sizes, loops, f"s = {total};")
    writer.program.add(
        looped(
            shape, outer, f"{{ {kind} s = {start}; {summed} {result.at(outer)} = s; }}"
        )
    )
    return [result]


@rule("argmin", "argmax")
def _extreme_index(
    writer: Writer, equation: Any, values: list[Value]
) -> Sequence[Value]:
    kind, shape = output_of(equation)
    (axis,) = equation.params["axes"]
    value = values[0]
    result = writer.program.new_array(kind, shape)
    outer = list(index_names(shape))
    first = value.at((*outer[:axis], "0", *outer[axis:]))
    other = value.at((*outer[:axis], "r", *outer[axis:]))
    sign = "<" if equation.primitive.name == "argmin" else ">"
    is_better = f"v {sign} best || (v != v && best == best)"
    search = (
        f"{{ {value.kind} best = {first}; {kind} at = 0; "
        f"for (int r = 1; r < {value.shape[axis]}; r++) {{ {value.kind} v = {other}; "
        f"if ({is_better}) {{ best = v; at = r; }} }} {result.at(tuple(outer))} = at; }}"
    )
    writer.program.add(looped(shape, tuple(outer), search))
    return [result]


@rule(*ACCUMULATIONS)
def _accumulate(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    axis = equation.params["axis"]
    result = writer.program.new_array(kind, shape)
    writer.program.assign(result, values[0])
    turned = equation.params.get("reverse", False)
    start, step = (shape[axis] - 1, -1) if turned else (0, 1)
    starts = [start if each == axis else 0 for each in range(len(shape))]
    steps = [step if each == axis else 1 for each in range(len(shape))]
    ordered = result.sliced(starts, shape, steps)
    names = list(index_names(shape))
    names[axis] = "r"
    before = [*names[:axis], "(r - 1)", *names[axis + 1 :]]
    here, last = ordered.at(tuple(names)), ordered.at(tuple(before))
    operation = ACCUMULATIONS[equation.primitive.name]
    total = combined(operation, kind, last, here)
    rest = shape[:axis] + shape[axis + 1 :]
    loop = f"for (int r = 1; r < {shape[axis]}; r++) {here} = {total};"
    others = (*names[:axis], *names[axis + 1 :])
    writer.program.add(looped(rest, others, loop))
    return [result]


@rule("dynamic_slice")
def _dynamic_slice(
    writer: Writer, equation: Any, values: list[Value]
) -> Sequence[Value]:
    _, shape = output_of(equation)
    value = writer.stored(values[0])
    return [_moved(writer, value, shape, values[1:])]


@rule("dynamic_update_slice")
def _dynamic_update(
    writer: Writer, equation: Any, values: list[Value]
) -> Sequence[Value]:
    kind, shape = output_of(equation)
    value, update, *starts = values
    result = writer.program.new_array(kind, shape)
    writer.program.assign(result, value)
    target = _moved(writer, result, update.shape, starts)
    writer.program.assign(target, update)
    return [result]


def _moved(writer: Writer, value: Stored, shape: Shape, starts: list[Value]) -> Stored:
    """View of a part whose start is known when the program runs."""
    offset = value.offset
    places = value.places
    for start, stride, size, part in zip(
        starts, value.strides, value.shape, shape, strict=True
    ):
        if size == part or not stride:
            continue
        index = writer.program.new_array("int32_t", ())
        clamped = f"s_imin(s_imax({start.at(())}, 0), {size - part})"
        writer.program.add(f"{index.at(())} = {clamped};")
        offset = f"{offset} + {index.at(())} * {stride}"
        places = places | index.places
    return Stored(value.kind, shape, value.base, value.strides, offset, places)


def _along(value: Any, axis: int, start: int, size: int) -> Any:
    """A part of an array along one axis."""
    starts = [start if each == axis else 0 for each in range(len(value.shape))]
    shape = tuple(size if each == axis else old for each, old in enumerate(value.shape))
    return value.sliced(starts, shape, (1,) * len(shape))


@rule("gather")
def _gather(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    operand, indices = (writer.stored(value) for value in values)
    params = equation.params
    numbers = params["dimension_numbers"]
    result = writer.program.new_array(kind, shape)
    names = index_names(shape)
    batch = [name for axis, name in enumerate(names) if axis not in numbers.offset_dims]
    windows = [names[axis] for axis in numbers.offset_dims]
    dropped = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    kept = [axis for axis in range(len(operand.shape)) if axis not in dropped]
    parts = _batch_parts(
        numbers.operand_batching_dims, numbers.start_indices_batching_dims, batch
    )
    parts |= dict(zip(kept, windows, strict=True))
    sizes = params["slice_sizes"]
    starts, inside = _starts(
        numbers.start_index_map, indices, batch, operand.shape, sizes
    )
    place = _element(operand, starts, parts)
    element = f"{result.at(names)} = {place};"
    if "FILL" in str(params["mode"]):
        filling = _filling(params["fill_value"], kind)
        element = f"{result.at(names)} = {inside} ? {place} : {filling};"
    writer.program.add(looped(shape, names, element))
    return [result]


@rule("scatter", "scatter-add", "scatter_add", "scatter-mul", "scatter_mul")
def _scatter(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    kind, shape = output_of(equation)
    operand, indices, updates = values
    indices, updates = writer.stored(indices), writer.stored(updates)
    numbers = equation.params["dimension_numbers"]
    result = writer.program.new_array(kind, shape)
    writer.program.assign(result, operand)
    names = index_names(updates.shape)
    window_axes = numbers.update_window_dims
    batch = [name for axis, name in enumerate(names) if axis not in window_axes]
    windows = [names[axis] for axis in window_axes]
    dropped = (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
    kept = [axis for axis in range(len(shape)) if axis not in dropped]
    parts = _batch_parts(
        numbers.operand_batching_dims, numbers.scatter_indices_batching_dims, batch
    )
    parts |= dict(zip(kept, windows, strict=True))
    window_sizes = dict(
        zip(kept, (updates.shape[axis] for axis in window_axes), strict=True)
    )
    sizes = [window_sizes.get(axis, 1) for axis in range(len(shape))]
    starts, inside = _starts(
        numbers.scatter_dims_to_operand_dims, indices, batch, shape, sizes
    )
    place = _element(result, starts, parts)
    value = updates.at(names)
    if equation.primitive.name.endswith("add"):
        value = combined("add", kind, place, value)
    if equation.primitive.name.endswith("mul"):
        value = combined("mul", kind, place, value)
    writer.program.add(
        looped(updates.shape, names, f"if ({inside}) {place} = {value};")
    )
    return [result]


def _batch_parts(
    axes: tuple[int, ...], index_axes: tuple[int, ...], batch: list[str]
) -> dict[int, str]:
    """Indices along axes that operand and indices share."""
    return {axis: batch[of] for axis, of in zip(axes, index_axes, strict=True)}


def _starts(
    axes: tuple[int, ...],
    indices: Stored,
    batch: list[str],
    shape: Shape,
    sizes: Any,
) -> tuple[dict[int, str], str]:
    """First indices of a window, kept inside, and whether they were inside."""
    starts = {}
    tests = []
    for number, axis in enumerate(axes):
        index = indices.at((*batch, str(number)))
        largest = shape[axis] - int(sizes[axis])
        starts[axis] = f"s_imin(s_imax({index}, 0), {largest})"
        tests.append(f"({index} >= 0 && {index} <= {largest})")
    return starts, " && ".join(tests) or "1"


def _element(array: Stored, starts: dict[int, str], parts: dict[int, str]) -> str:
    indices = []
    for axis in range(len(array.shape)):
        terms = [part[axis] for part in (starts, parts) if axis in part]
        terms = [term for term in terms if term != "0"] or ["0"]
        joined = " + ".join(terms)
        indices.append(f"({joined})" if len(terms) > 1 else joined)
    return array.at(tuple(indices))


def _filling(value: Any, kind: Kind) -> str:
    if value is not None:
        return literal(value)
    return "NAN" if kind == "float" else "INT32_MIN"


@rule("sort", "top_k")
def _sort(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    """Stable insertion sort of one axis: rows are short."""
    params = equation.params
    is_top = equation.primitive.name == "top_k"
    axis = params["axis" if is_top and "axis" in params else "dimension"]
    if not is_top and params["num_keys"] != 1:
        raise S2C2AError("a sort by several keys cannot be exported to C")
    arrays = [writer.stored(value) for value in values]
    keys = arrays[0]
    size = keys.shape[axis]
    outer_shape = keys.shape[:axis] + keys.shape[axis + 1 :]
    outer = index_names(outer_shape)
    order = writer.program.new_array("int32_t", (size,))

    def at(array: Stored, index: str) -> str:
        return array.at((*outer[:axis], index, *outer[axis:]))

    results = [
        writer.program.new_array(*output_of(equation, number))
        for number in range(len(equation.outvars))
    ]
    count = results[0].shape[axis]
    now, before = at(keys, "c"), at(keys, order.at(("(j - 1)",)))
    less = f"s_less({before}, {now})" if is_top else f"s_less({now}, {before})"
    if keys.kind != "float":
        less = f"{before} < {now}" if is_top else f"{now} < {before}"
    copies = [f"{at(results[0], 'r')} = {at(keys, order.at(('r',)))};"]
    if is_top:
        copies.append(f"{at(results[1], 'r')} = {order.at(('r',))};")
    else:
        copies += [
            f"{at(result, 'r')} = {at(array, order.at(('r',)))};"
            for result, array in zip(results[1:], arrays[1:], strict=True)
        ]
    statement = (
        f"{{ for (int c = 0; c < {size}; c++) {{ int j = c; "
        f"for (; j > 0 && {less}; j--) "
        f"{order.at(('j',))} = {order.at(('(j - 1)',))}; {order.at(('j',))} = c; }} "
        f"for (int r = 0; r < {count}; r++) {{ {' '.join(copies)} }} }}"
    )
    writer.program.add(looped(outer_shape, outer, statement))
    return results
