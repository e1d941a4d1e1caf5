"""What is known of a jaxpr before it is written: order, calls, constant results."""

from collections.abc import Container, Sequence
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Var

MAX_FOLDED = 4096  # elements of an array that is computed when the program is written
NESTED = {"jit", "pjit", "closed_call", "core_call", "remat", "checkpoint"}
CUSTOM = {"custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr"}
CONTROL = {"scan", "while", "cond"}
UNCHANGED = {
    "copy",
    "copy_p",
    "stop_gradient",
    "reduce_precision",
    "optimization_barrier",
    "real",
}
"""Primitives that return their operand."""


def described(variable: Any) -> Any:
    """Shape and type of a variable."""
    return variable.aval


def result_shape(equation: JaxprEqn) -> tuple[int, ...]:
    """Shape of the first result."""
    return tuple(described(equation.outvars[0]).shape)


def other_axes(rank: int, axes: Container[int]) -> list[int]:
    """The axes of an array that are not among some."""
    return [axis for axis in range(rank) if axis not in axes]


def inner_call(
    equation: JaxprEqn, operands: Sequence[Any]
) -> tuple[ClosedJaxpr, Sequence[Any]] | None:
    """The jaxpr that an operation stands for, and its inputs; None if it is no call."""
    name = equation.primitive.name
    params = equation.params
    if name in NESTED:
        return params["jaxpr"], operands
    if name in CUSTOM:
        return params.get("call_jaxpr") or params["fun_jaxpr"], operands
    if name == "custom_linear_solve":
        counts = params["const_lengths"]
        first = counts.matvec + counts.vecmat
        last = first + counts.solve
        constants = operands[first:last]
        right_sides = operands[sum(counts) :]
        return params["jaxprs"].solve, [*constants, *right_sides]
    return None


def needed_equations(
    jaxpr: Jaxpr, wanted: list[bool]
) -> list[tuple[JaxprEqn, list[bool]]]:
    """Operations whose results are used, in order, and which results."""
    pairs = zip(jaxpr.outvars, wanted, strict=True)
    used = {variable for variable, want in pairs if want and isinstance(variable, Var)}
    found = []
    for equation in reversed(jaxpr.eqns):
        is_used = [variable in used for variable in equation.outvars]
        if not any(is_used):
            continue
        found.append((equation, is_used))
        used |= {variable for variable in equation.invars if isinstance(variable, Var)}
    return found[::-1]


def folded(equation: JaxprEqn, operands: Sequence[Any]) -> list[np.ndarray] | None:
    """Results that do not depend on inputs, unless they are large."""
    if equation.primitive.name in CONTROL:
        return None
    if not all(isinstance(operand, np.ndarray) for operand in operands):
        return None
    if max(described(variable).size for variable in equation.outvars) > MAX_FOLDED:
        return None
    result = equation.primitive.bind(*operands, **equation.params)
    results = result if equation.primitive.multiple_results else [result]
    return [np.asarray(each) for each in results]


NEUTRAL = {"mul": 1.0, "div": 1.0, "add": 0.0, "sub": 0.0, "add_any": 0.0}
"""Right operand that changes nothing, by the name of the primitive."""
COMMUTING = {"mul", "add", "add_any"}


def simplified(equation: JaxprEqn, operands: Sequence[Any]) -> Any:
    """The operand that an operation returns, where another one is constant, or None."""
    name = equation.primitive.name
    if name == "select_n":
        which, *cases = operands
        if not isinstance(which, np.ndarray) or (which != which.flat[0]).any():
            return None
        return cases[int(which.flat[0])]
    if name not in NEUTRAL:
        return None
    left, right = operands
    pairs = [(left, right)]
    if name in COMMUTING:
        pairs.append((right, left))
    for operand, other in pairs:
        if not isinstance(other, np.ndarray) or (other != NEUTRAL[name]).any():
            continue
        if operand.shape == result_shape(equation):
            return operand
    return None
