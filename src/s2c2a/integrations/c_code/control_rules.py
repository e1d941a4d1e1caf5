"""Rules of loops and branches: bodies become C functions of their own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from s2c2a.integrations.c_code.array_rules import (
    Values,
    cheap,
    clamped,
    copied,
    new_result,
    places_of,
)
from s2c2a.integrations.c_code.values import Stored, Value
from s2c2a.integrations.c_code.writer import Writer, rule


@rule("scan")
def _scan(writer: Writer, equation: Any, values: Values) -> Values:
    params = equation.params
    carried = params["num_carry"]
    constants = params["num_consts"]
    read_whole = constants + carried
    program = writer.program
    fixed = [cheap(writer, value) for value in values[:constants]]
    carry = [copied(writer, value) for value in values[constants:read_whole]]
    rows = [writer.stored(value) for value in values[read_whole:]]
    outputs = _new_results(writer, equation, carried)
    index = program.new_name("t")
    with program.body(index) as call, writer.protecting([*carry, *rows, *outputs]):
        now = [_row(array, index) for array in rows]
        written = writer.write_closed(params["jaxpr"], [*fixed, *carry, *now])
        for array, value in zip(outputs, written[carried:], strict=True):
            target = _row(array, index)
            program.assign(target, value)
        _replace(writer, carry, written[:carried])
    rounds = _rounds(index, params["length"], params["reverse"])
    program.add(f"for ({rounds}) {{ {call[0]} }}")
    return [*carry, *outputs]


def _new_results(writer: Writer, equation: Any, first: int = 0) -> list[Stored]:
    """New arrays for all results from one on."""
    numbers = range(first, len(equation.outvars))
    return [new_result(writer, equation, number) for number in numbers]


def _rounds(index: str, length: int, is_turned: bool) -> str:
    """Head of a loop over rows."""
    last = length - 1
    if is_turned:
        return f"int {index} = {last}; {index} >= 0; {index}--"
    return f"int {index} = 0; {index} <= {last}; {index}++"


@rule("while")
def _while(writer: Writer, equation: Any, values: Values) -> Values:
    params = equation.params
    tests = params["cond_nconsts"]
    constants = tests + params["body_nconsts"]
    fixed = [cheap(writer, value) for value in values[:constants]]
    state = [copied(writer, value) for value in values[constants:]]
    for_test = fixed[:tests]
    for_body = fixed[tests:]
    program = writer.program
    goes_on = program.new_array("int32_t", ())
    with program.body() as test, writer.protecting([*fixed, *state, goes_on]):
        (result,) = writer.write_closed(params["cond_jaxpr"], [*for_test, *state])
        program.assign(goes_on, result)
    with program.body() as call, writer.protecting([*fixed, *state, goes_on]):
        written = writer.write_closed(params["body_jaxpr"], [*for_body, *state])
        _replace(writer, state, written)
    condition = goes_on.at(())
    program.add(f"for (;;) {{ {test[0]} if (!{condition}) break; {call[0]} }}")
    return state


@rule("cond")
def _branches(writer: Writer, equation: Any, values: Values) -> Values:
    which, *inputs = values
    operands = [cheap(writer, value) for value in inputs]
    outputs = _new_results(writer, equation)
    cases = []
    branches = equation.params["branches"]
    for number, branch in enumerate(branches):
        call = _branch_call(writer, branch, operands, outputs)
        cases.append(f"case {number}: {{ {call} break; }} ")
    last = len(branches) - 1
    chosen = clamped(which.at(()), last)
    joined = "".join(cases)
    writer.program.add(f"switch ({chosen}) {{ {joined}}}")
    return outputs


def _branch_call(
    writer: Writer, branch: Any, operands: Values, outputs: Sequence[Stored]
) -> str:
    """Write a branch as a function; returns its call."""
    program = writer.program
    with program.body() as call, writer.protecting([*operands, *outputs]):
        written = writer.write_closed(branch, operands)
        for output, value in zip(outputs, written, strict=True):
            program.assign(output, value)
    return call[0]


def _row(array: Stored, index: str) -> Stored:
    """Element of the first axis, by an index that is known when the program runs."""
    stride = array.strides[0]
    offset = array.offset
    if stride:
        offset = f"{offset} + {index} * {stride}"
    return replace(
        array, shape=array.shape[1:], strides=array.strides[1:], offset=offset
    )


def _replace(writer: Writer, state: list[Stored], values: Sequence[Value]) -> None:
    """Set a loop's state; new values may read the old ones, so they are stored first."""
    moved = []
    for old, new in zip(state, values, strict=True):
        if new is old:
            continue
        safe = new if _is_apart(new, state) else copied(writer, new)
        moved.append((old, safe))
    for old, safe in moved:
        writer.program.assign(old, safe)


def _is_apart(value: Value, state: list[Stored]) -> bool:
    return value.places.isdisjoint(places_of(state))
