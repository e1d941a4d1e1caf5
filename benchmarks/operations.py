"""Operations counted in the JAX trace of a program: a lower bound for any compiler.

Loops count as often as they turn, those whose turns follow from data once; of branches
the cheapest counts, so a plan counts as one without obstacles. XLA's own cost analysis
counts every loop once.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import jax
from jax.extend import core

TRANSCENDENTAL = set(
    [
        "acos",
        "asin",
        "atan2",
        "cos",
        "erf",
        "exp",
        "expm1",
        "log",
        "log1p",
        "logistic",
        "pow",
        "rsqrt",
        "sin",
        "sqrt",
        "tan",
        "tanh",
    ]
)
ARITHMETIC = set(
    [
        "abs",
        "add",
        "add_any",
        "and",
        "clamp",
        "div",
        "eq",
        "ge",
        "gt",
        "integer_pow",
        "le",
        "lt",
        "max",
        "min",
        "mul",
        "ne",
        "neg",
        "not",
        "or",
        "select_n",
        "sign",
        "square",
        "sub",
    ]
)
REDUCTIONS = set(
    [
        "argmax",
        "argmin",
        "cumsum",
        "reduce_and",
        "reduce_max",
        "reduce_min",
        "reduce_or",
        "reduce_sum",
    ]
)


def count_operations(function: Callable[..., Any], *inputs: Any) -> Counter:
    """Counts of one call: "arithmetic", "transcendental", and "bytes" of products."""
    return _of_program(jax.make_jaxpr(function)(*inputs).jaxpr)


def _of_program(program: core.Jaxpr) -> Counter:
    return sum((_of_equation(equation) for equation in program.eqns), Counter())


def _of_equation(equation: core.JaxprEqn) -> Counter:
    name = equation.primitive.name
    inner = [_of_program(program) for program in _programs_in(equation.params)]
    if name == "cond":
        return min(inner, key=lambda counted: counted["arithmetic"])
    if inner:
        turns = equation.params["length"] if name == "scan" else 1
        return Counter(
            {kind: turns * count for kind, count in sum(inner, Counter()).items()}
        )
    first = equation.invars[0].aval.shape if equation.invars else ()
    results = sum(map(_size, equation.outvars))
    if name == "dot_general":
        (contracted, _), _ = equation.params["dimension_numbers"]
        multiplied = 2 * math.prod(first[axis] for axis in contracted) * results
        return Counter(
            arithmetic=multiplied,
            bytes=4 * sum(map(_size, (*equation.invars, *equation.outvars))),
        )
    if name in TRANSCENDENTAL:
        return Counter(transcendental=results)
    arithmetic = {
        **dict.fromkeys(ARITHMETIC, results),
        **dict.fromkeys(REDUCTIONS, math.prod(first)),
        "lu": math.prod(first) * first[-1] * 2 // 3 if first else 0,
        "triangular_solve": results * first[-1] if first else 0,
    }
    return Counter(arithmetic=arithmetic.get(name, 0))  # others move or name values


def _programs_in(parameters: dict[str, Any]) -> Iterator[core.Jaxpr]:
    """Programs within an equation; of a differentiable linear solve, the solve only."""
    if "jaxprs" in parameters:
        parameters = {"solve": parameters["jaxprs"].solve}
    for value in parameters.values():
        for part in value if isinstance(value, tuple | list) else (value,):
            if isinstance(part, core.ClosedJaxpr | core.Jaxpr):
                yield getattr(part, "jaxpr", part)


def _size(variable: Any) -> int:
    return math.prod(variable.aval.shape)
