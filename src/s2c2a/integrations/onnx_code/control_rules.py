"""Rules of loops and branches: their bodies are graphs inside a node."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from s2c2a.integrations.jaxprs import described
from s2c2a.integrations.onnx_code.graph import Body, GraphProto, Operand, Operands
from s2c2a.integrations.onnx_code.writer import GraphWriter, results_of, rule


@rule("scan")
def _scan(writer: GraphWriter, equation: Any, operands: Operands) -> Sequence[Operand]:
    params = equation.params
    constants = params["num_consts"]
    read_whole = constants + params["num_carry"]
    fixed = operands[:constants]
    carry = operands[constants:read_whole]
    rows = operands[read_whole:]
    length = params["length"]
    if not length:
        return [*carry, *_no_rows(equation)]
    if rows:
        body = _scan_body(writer, equation, fixed, carry, rows)
    else:
        # a loop needs some rows
        rows = [np.arange(length, dtype=np.int32)]
        body = _scan_body(writer, equation, fixed, carry, rows, is_counter=True)
    names = writer.graph.nodes_of(
        "Scan",
        _names(writer, [*carry, *rows]),
        len(equation.outvars),
        body=body,
        num_scan_inputs=len(rows),
        **_directions(equation, len(rows)),
    )
    return results_of(equation, names)


def _names(writer: GraphWriter, operands: Sequence[Operand]) -> list[str]:
    return [writer.full(operand) for operand in operands]


def _no_rows(equation: Any) -> list[np.ndarray]:
    """What a loop without rounds collects."""
    carried = equation.params["num_carry"]
    collected = []
    for variable in equation.outvars[carried:]:
        aval = described(variable)
        empty = np.zeros(aval.shape, aval.dtype)
        collected.append(empty)
    return collected


def _scan_body(
    writer: GraphWriter,
    equation: Any,
    fixed: Operands,
    carry: Operands,
    rows: Operands,
    is_counter: bool = False,
) -> GraphProto:
    """One round; it does not read rows that only count rounds."""
    with writer.graph.body() as body:
        state = [body.input(each.dtype, each.shape) for each in carry]
        now = [body.input(each.dtype, each.shape[1:]) for each in rows]
        inputs = [*fixed, *state]
        if not is_counter:
            inputs += now
        outputs = writer.write_closed(equation.params["jaxpr"], inputs)
        _add_outputs(writer, body, outputs)
    return body.proto()


def _add_outputs(writer: GraphWriter, body: Body, operands: Sequence[Operand]) -> None:
    for operand in operands:
        name = writer.full(operand)
        body.output(name, operand.dtype, operand.shape)


def _directions(equation: Any, rows: int) -> dict[str, list[int]]:
    """Attributes that tell whether a loop begins with the last row."""
    params = equation.params
    is_turned = int(params["reverse"])
    directions = {"scan_input_directions": [is_turned] * rows}
    collected = len(equation.outvars) - params["num_carry"]
    if collected:  # an empty list has no type
        directions["scan_output_directions"] = [is_turned] * collected
    return directions


@rule("while")
def _while(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    params = equation.params
    tests = params["cond_nconsts"]
    constants = tests + params["body_nconsts"]
    for_test = operands[:tests]
    for_body = operands[tests:constants]
    start = operands[constants:]

    def goes_on(state: Sequence[Operand]) -> str:
        inputs = [*for_test, *state]
        (result,) = writer.write_closed(params["cond_jaxpr"], inputs)
        return writer.full(result)

    with writer.graph.body() as body:
        body.input(np.int64, ())  # number of the round
        body.input(np.bool_, ())  # known to be true
        state = [body.input(each.dtype, each.shape) for each in start]
        inputs = [*for_body, *state]
        after = writer.write_closed(params["body_jaxpr"], inputs)
        body.output(goes_on(after), np.bool_, ())
        _add_outputs(writer, body, after)
    no_limit = ""
    names = [no_limit, goes_on(start), *_names(writer, start)]
    results = writer.graph.nodes_of("Loop", names, len(start), body=body.proto())
    return results_of(equation, results)


@rule("cond")
def _branches(writer: GraphWriter, equation: Any, operands: Operands) -> Any:
    which, *inputs = operands
    if isinstance(which, np.ndarray):
        branches = equation.params["branches"]
        last = len(branches) - 1
        number = np.clip(which, 0, last)
        return writer.write_closed(branches[int(number)], inputs)
    name = writer.full(which)
    write = _chosen(writer, equation, name, inputs, 0)
    return results_of(equation, write())


Write = Callable[[], list[str]]
"""Writes a branch; returns the names of its results."""


def _chosen(
    writer: GraphWriter, equation: Any, which: str, inputs: Operands, number: int
) -> Write:
    """Write the branch of a number, or one behind it."""
    graph = writer.graph
    branches = equation.params["branches"]

    def written() -> list[str]:
        outputs = writer.write_closed(branches[number], inputs)
        return _names(writer, outputs)

    if number == len(branches) - 1:
        return written
    later = _chosen(writer, equation, which, inputs, number + 1)

    def nested() -> list[str]:
        then = _branch_body(writer, equation, later)
        other = _branch_body(writer, equation, written)
        limit = graph.constant(np.array(number, np.int32))
        test = graph.node("Greater", which, limit)
        count = len(equation.outvars)
        return graph.nodes_of("If", [test], count, then_branch=then, else_branch=other)

    return nested


def _branch_body(writer: GraphWriter, equation: Any, write: Write) -> GraphProto:
    with writer.graph.body() as body:
        names = write()
        for name, variable in zip(names, equation.outvars, strict=True):
            aval = described(variable)
            body.output(name, aval.dtype, aval.shape)
    return body.proto()
