"""Jaxprs of fewer kinds of operations, for converters that do not know all of them."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, JaxprEqn, Literal, Var

CALLS = ("jit", "pjit", "closed_call", "custom_jvp_call", "custom_vjp_call")
TOTAL_ORDER = {"lt_to": jax.lax.lt, "le_to": jax.lax.le}
"""Comparisons that differ from the usual ones in the order of NaN and of signed zeros."""


def plain_function(closed: ClosedJaxpr) -> Callable[..., list[Any]]:
    """The function of a jaxpr in fewer kinds of operations.

    There are no calls, reversed scans, scans within loops, total orders and empty
    arrays.
    """
    return partial(_evaluated, closed, False)


def _evaluated(closed: ClosedJaxpr, is_inner: bool, *inputs: Any) -> list[Any]:
    """Outputs of a jaxpr; `is_inner` in the body of a loop."""
    values: dict[Var, Any] = {}
    values.update(zip(closed.jaxpr.constvars, closed.consts, strict=True))
    values.update(zip(closed.jaxpr.invars, inputs, strict=True))

    def read(variable: Any) -> Any:
        return variable.val if isinstance(variable, Literal) else values[variable]

    for equation in closed.jaxpr.eqns:
        operands = [read(variable) for variable in equation.invars]
        results = _results(equation, is_inner, operands)
        values.update(zip(equation.outvars, results, strict=True))
    return [read(variable) for variable in closed.jaxpr.outvars]


def _results(equation: JaxprEqn, is_inner: bool, operands: list[Any]) -> Sequence[Any]:
    name, params = equation.primitive.name, equation.params
    if name in CALLS:
        inner = params["jaxpr" if "jaxpr" in params else "call_jaxpr"]
        return _evaluated(inner, is_inner, *operands)
    if name == "scan":
        return _unrolled(params, operands) if is_inner else _scanned(params, operands)
    if name == "while":
        return _looped(params, operands)
    if name == "cond":
        branches = [
            partial(_evaluated, branch, is_inner) for branch in params["branches"]
        ]
        return jax.lax.switch(operands[0], branches, *operands[1:])
    if name == "custom_linear_solve":
        return _solved(params, is_inner, operands)
    if name in TOTAL_ORDER:
        return [TOTAL_ORDER[name](*operands)]
    if name == "concatenate":
        operands = [operand for operand in operands if operand.size]
    if name == "scatter" and not operands[1].size:
        return [operands[2]]  # without indices, all is replaced
    result = equation.primitive.bind(*operands, **params)
    return result if equation.primitive.multiple_results else [result]


def _split(
    params: dict[str, Any], operands: list[Any]
) -> tuple[list[Any], tuple, tuple]:
    """Constants, first carry and rows of a scan."""
    constants, carried = params["num_consts"], params["num_carry"]
    rest = operands[constants:]
    return operands[:constants], tuple(rest[:carried]), tuple(rest[carried:])


def _scanned(params: dict[str, Any], operands: list[Any]) -> list[Any]:
    fixed, start, rows = _split(params, operands)
    carried, length = len(start), params["length"]
    turn = partial(jnp.flip, axis=0) if params["reverse"] else (lambda array: array)

    def body(carry: tuple, row: tuple) -> tuple[tuple, tuple]:
        results = _evaluated(params["jaxpr"], True, *fixed, *carry, *row)
        return tuple(results[:carried]), tuple(results[carried:])

    turned = tuple(turn(row) for row in rows)
    end, outputs = jax.lax.scan(body, start, turned, length=length)
    return [*end, *(turn(output) for output in outputs)]


def _unrolled(params: dict[str, Any], operands: list[Any]) -> list[Any]:
    fixed, state, rows = _split(params, operands)
    carried, length = len(state), params["length"]
    outputs: dict[int, Sequence[Any]] = {}
    for number in reversed(range(length)) if params["reverse"] else range(length):
        now = [row[number] for row in rows]
        results = _evaluated(params["jaxpr"], True, *fixed, *state, *now)
        state, outputs[number] = tuple(results[:carried]), results[carried:]
    stacked = zip(*(outputs[number] for number in range(length)), strict=True)
    return [*state, *(jnp.stack(each) for each in stacked)]


def _looped(params: dict[str, Any], operands: list[Any]) -> list[Any]:
    tests, constants = params["cond_nconsts"], params["body_nconsts"]
    for_test, rest = operands[:tests], operands[tests:]
    for_body, start = rest[:constants], tuple(rest[constants:])

    def goes_on(state: Any) -> Any:
        return _evaluated(params["cond_jaxpr"], True, *for_test, *state)[0]

    def body(state: Any) -> Any:
        return tuple(_evaluated(params["body_jaxpr"], True, *for_body, *state))

    return list(jax.lax.while_loop(goes_on, body, start))


def _solved(params: dict[str, Any], is_inner: bool, operands: list[Any]) -> list[Any]:
    counts = params["const_lengths"]
    first = counts.matvec + counts.vecmat
    constants = operands[first : first + counts.solve]
    rights = operands[sum(counts) :]
    return _evaluated(params["jaxprs"].solve, is_inner, *constants, *rights)
