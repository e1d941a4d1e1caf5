"""Rules of loops and branches: bodies become C functions of their own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from s2c2a.integrations.c_code.array_rules import (
    Values,
    cheap,
    clamped,
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
    carry = [writer.program.copied(value) for value in values[constants:read_whole]]
    rows = [writer.program.stored(value) for value in values[read_whole:]]
    outputs = _new_results(writer, equation, carried)
    index = program.new_name("t")
    with program.body(index) as call, writer.protecting([*carry, *rows, *outputs]):
        now = [_row(array, index) for array in rows]
        written = writer.write_closed(params["jaxpr"], [*fixed, *carry, *now])
        for array, value in zip(outputs, written[carried:], strict=True):
            target = _row(array, index)
            program.assign(target, value)
        _replace(writer, carry, written[:carried])
    last = params["length"] - 1
    rounds = f"int {index} = 0; {index} <= {last}; {index}++"
    if params["reverse"]:
        rounds = f"int {index} = {last}; {index} >= 0; {index}--"
    program.add(f"for ({rounds}) {{ {call[0]} }}")
    return [*carry, *outputs]


def _new_results(writer: Writer, equation: Any, first: int = 0) -> list[Stored]:
    """New arrays for all results from one on."""
    numbers = range(first, len(equation.outvars))
    return [new_result(writer, equation, number) for number in numbers]


@rule("while")
def _while(writer: Writer, equation: Any, values: Values) -> Values:
    params = equation.params
    tests = params["cond_nconsts"]
    constants = tests + params["body_nconsts"]
    fixed = [cheap(writer, value) for value in values[:constants]]
    state = [writer.program.copied(value) for value in values[constants:]]
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
    program = writer.program
    for number, branch in enumerate(branches):
        with program.body() as call, writer.protecting([*operands, *outputs]):
            written = writer.write_closed(branch, operands)
            for output, value in zip(outputs, written, strict=True):
                program.assign(output, value)
        cases.append(f"case {number}: {{ {call[0]} break; }} ")
    last = len(branches) - 1
    chosen = clamped(which.at(()), last)
    joined = "".join(cases)
    program.add(f"switch ({chosen}) {{ {joined}}}")
    return outputs


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
        is_apart = new.places.isdisjoint(places_of(state))
        safe = new if is_apart else writer.program.copied(new)
        moved.append((old, safe))
    for old, safe in moved:
        writer.program.assign(old, safe)
