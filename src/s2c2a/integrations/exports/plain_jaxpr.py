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
    """The function of a jaxpr without calls, reversed scans, total orders and empty arrays."""
    return partial(_evaluated, closed)


def _evaluated(closed: ClosedJaxpr, *inputs: Any) -> list[Any]:
    values: dict[Var, Any] = {}
    values.update(zip(closed.jaxpr.constvars, closed.consts, strict=True))
    values.update(zip(closed.jaxpr.invars, inputs, strict=True))

    def read(variable: Any) -> Any:
        return variable.val if isinstance(variable, Literal) else values[variable]

    for equation in closed.jaxpr.eqns:
        operands = [read(variable) for variable in equation.invars]
        results = _results(equation, operands)
        values.update(zip(equation.outvars, results, strict=True))
    return [read(variable) for variable in closed.jaxpr.outvars]


def _results(equation: JaxprEqn, operands: list[Any]) -> Sequence[Any]:
    name, params = equation.primitive.name, equation.params
    if name in CALLS:
        inner = params["jaxpr" if "jaxpr" in params else "call_jaxpr"]
        return _evaluated(inner, *operands)
    if name == "scan":
        return _scanned(params, operands)
    if name == "while":
        return _looped(params, operands)
    if name == "cond":
        branches = [partial(_evaluated, branch) for branch in params["branches"]]
        return jax.lax.switch(operands[0], branches, *operands[1:])
    if name == "custom_linear_solve":
        return _solved(params, operands)
    if name in TOTAL_ORDER:
        return [TOTAL_ORDER[name](*operands)]
    if name == "concatenate":
        operands = [operand for operand in operands if operand.size]
    if name == "scatter" and not operands[1].size:
        return [operands[2]]  # without indices, all is replaced
    result = equation.primitive.bind(*operands, **params)
    return result if equation.primitive.multiple_results else [result]


def _scanned(params: dict[str, Any], operands: list[Any]) -> list[Any]:
    constants, carried = params["num_consts"], params["num_carry"]
    fixed = operands[:constants]
    start = tuple(operands[constants:][:carried])
    rows = tuple(operands[constants + carried :])
    turn = partial(jnp.flip, axis=0) if params["reverse"] else (lambda array: array)

    def body(carry: tuple, row: tuple) -> tuple[tuple, tuple]:
        results = _evaluated(params["jaxpr"], *fixed, *carry, *row)
        return tuple(results[:carried]), tuple(results[carried:])

    turned = tuple(turn(row) for row in rows)
    end, outputs = jax.lax.scan(body, start, turned, length=params["length"])
    return [*end, *(turn(output) for output in outputs)]


def _looped(params: dict[str, Any], operands: list[Any]) -> list[Any]:
    tests, constants = params["cond_nconsts"], params["body_nconsts"]
    for_test, rest = operands[:tests], operands[tests:]
    for_body, start = rest[:constants], tuple(rest[constants:])

    def goes_on(state: tuple) -> Any:
        return _evaluated(params["cond_jaxpr"], *for_test, *state)[0]

    def body(state: tuple) -> tuple:
        return tuple(_evaluated(params["body_jaxpr"], *for_body, *state))

    return list(jax.lax.while_loop(goes_on, body, start))


def _solved(params: dict[str, Any], operands: list[Any]) -> list[Any]:
    counts = params["const_lengths"]
    first = counts.matvec + counts.vecmat
    constants = operands[first : first + counts.solve]
    rights = operands[sum(counts) :]
    return _evaluated(params["jaxprs"].solve, *constants, *rights)
