"""Rules of loops and branches: bodies become C functions of their own."""

from collections.abc import Sequence
from typing import Any

from s2c2a.integrations.c_code.array_rules import output_of
from s2c2a.integrations.c_code.values import Stored, Value
from s2c2a.integrations.c_code.writer import Writer, rule


@rule("scan")
def _scan(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    params = equation.params
    constants, carried = params["num_consts"], params["num_carry"]
    program = writer.program
    fixed = [_cheap(writer, value) for value in values[:constants]]
    carry = [_copied(writer, value) for value in values[constants:][:carried]]
    rows = [writer.stored(value) for value in values[constants + carried :]]
    outputs = [
        program.new_array(*output_of(equation, number))
        for number in range(carried, len(equation.outvars))
    ]
    index = program.new_name("t")
    with program.body(index) as call, writer.protecting([*carry, *rows, *outputs]):
        now = [_row(array, index) for array in rows]
        written = writer.write_closed(params["jaxpr"], [*fixed, *carry, *now])
        for array, value in zip(outputs, written[carried:], strict=True):
            program.assign(_row(array, index), value)
        _replace(writer, carry, written[:carried])
    last = params["length"] - 1
    up = f"int {index} = 0; {index} <= {last}; {index}++"
    down = f"int {index} = {last}; {index} >= 0; {index}--"
    program.add(f"for ({down if params['reverse'] else up}) {{ {call[0]} }}")
    return [*carry, *outputs]


@rule("while")
def _while(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    params = equation.params
    tests, constants = params["cond_nconsts"], params["body_nconsts"]
    fixed = [_cheap(writer, value) for value in values[: tests + constants]]
    state = [_copied(writer, value) for value in values[tests + constants :]]
    program = writer.program
    goes_on = program.new_array("int32_t", ())
    with program.body() as test, writer.protecting([*fixed, *state, goes_on]):
        (result,) = writer.write_closed(params["cond_jaxpr"], [*fixed[:tests], *state])
        program.assign(goes_on, result)
    with program.body() as call, writer.protecting([*fixed, *state, goes_on]):
        written = writer.write_closed(params["body_jaxpr"], [*fixed[tests:], *state])
        _replace(writer, state, written)
    condition = goes_on.at(())
    program.add(f"for (;;) {{ {test[0]} if (!{condition}) break; {call[0]} }}")
    return state


@rule("cond")
def _branches(writer: Writer, equation: Any, values: list[Value]) -> Sequence[Value]:
    branches = equation.params["branches"]
    program = writer.program
    which, *operands = values
    operands = [_cheap(writer, value) for value in operands]
    outputs = [
        program.new_array(*output_of(equation, number))
        for number in range(len(equation.outvars))
    ]
    calls = []
    for branch in branches:
        with program.body() as call, writer.protecting([*operands, *outputs]):
            written = writer.write_closed(branch, operands)
            for output, value in zip(outputs, written, strict=True):
                program.assign(output, value)
        calls.append(call[0])
    chosen = f"s_imin(s_imax({which.at(())}, 0), {len(branches) - 1})"
    cases = "".join(
        f"case {number}: {{ {call} break; }} " for number, call in enumerate(calls)
    )
    program.add(f"switch ({chosen}) {{ {cases}}}")
    return outputs


def _cheap(writer: Writer, value: Value) -> Value:
    """A value that costs nothing to read again and again."""
    return writer.stored(value) if value.cost else value


def _copied(writer: Writer, value: Value) -> Stored:
    """An array of its own, which a loop may change."""
    array = writer.program.new_array(value.kind, value.shape)
    writer.program.assign(array, value)
    return array


def _row(array: Stored, index: str) -> Stored:
    """Element of the first axis, by an index that is known when the program runs."""
    stride = array.strides[0]
    offset = f"{array.offset} + {index} * {stride}" if stride else array.offset
    return Stored(
        array.kind,
        array.shape[1:],
        array.base,
        array.strides[1:],
        offset,
        array.places,
    )


def _replace(writer: Writer, state: list[Stored], values: Sequence[Value]) -> None:
    """Set a loop's state; new values may read the old ones, so they are stored first."""
    moved = [
        (old, new if _is_apart(new, state) else _copied(writer, new))
        for old, new in zip(state, values, strict=True)
        if new is not old
    ]
    for old, new in moved:
        writer.program.assign(old, new)


def _is_apart(value: Value, state: list[Stored]) -> bool:
    places = frozenset().union(*(array.places for array in state))
    return not value.places & places
