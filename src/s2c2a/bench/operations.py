"""Operations of a program, counted in what JAX traces of it: the floor that no compiler goes below.

Loops count as often as they turn; of branches the cheapest counts, so a plan counts as one without obstacles.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
from jax.extend import core

# fmt: off
TRANSCENDENTAL = {
    "acos", "asin", "atan2", "cos", "erf", "exp", "expm1", "log", "log1p", "logistic", "pow", "rsqrt", "sin",
    "sqrt", "tan", "tanh",
}
ARITHMETIC = {
    "abs", "add", "add_any", "and", "clamp", "div", "eq", "ge", "gt", "integer_pow", "le", "lt", "max", "min",
    "mul", "ne", "neg", "not", "or", "select_n", "sign", "square", "sub",
}
REDUCTIONS = {
    "argmax", "argmin", "cumsum", "reduce_and", "reduce_max", "reduce_min", "reduce_or", "reduce_sum",
}
# fmt: on


class Operations(NamedTuple):
    """What a program does.

    Attributes:
        arithmetic: additions, multiplications, comparisons.
        transcendental: roots, exponentials, sines and their kin.
        matrix_bytes: bytes that matrix products read and write, each time they run.
    """

    arithmetic: float = 0.0
    transcendental: float = 0.0
    matrix_bytes: float = 0.0

    def times(self, count: float) -> "Operations":
        """Done so often."""
        return Operations(*(count * value for value in self))

    def plus(self, other: "Operations") -> "Operations":
        """Both done."""
        return Operations(*(one + two for one, two in zip(self, other, strict=True)))


def count_operations(function: Callable[..., Any], *inputs: Any) -> Operations:
    """Operations of one call; loops whose turns follow from data count once."""
    return _of_program(jax.make_jaxpr(function)(*inputs).jaxpr)


def _of_program(program: core.Jaxpr) -> Operations:
    total = Operations()
    for equation in program.eqns:
        total = total.plus(_of_equation(equation))
    return total


def _of_equation(equation: core.JaxprEqn) -> Operations:
    name, parameters = equation.primitive.name, equation.params
    inner = [_of_program(program) for program in _programs_in(parameters)]
    if name == "cond":
        return min(inner, key=lambda operations: operations.arithmetic)
    if inner:
        total = Operations()
        for operations in inner:
            total = total.plus(operations)
        return total.times(parameters["length"] if name == "scan" else 1)
    results = sum(_size(variable) for variable in equation.outvars)
    if name in ARITHMETIC:
        return Operations(arithmetic=results)
    if name in TRANSCENDENTAL:
        return Operations(transcendental=results)
    if name in REDUCTIONS:
        return Operations(arithmetic=_size(equation.invars[0]))
    if name == "dot_general":
        (contracted, _), _ = parameters["dimension_numbers"]
        shape = _shape(equation.invars[0])
        moved = sum(4 * _size(variable) for variable in (*equation.invars, *equation.outvars))
        return Operations(arithmetic=2.0 * math.prod(shape[axis] for axis in contracted) * results, matrix_bytes=moved)
    if name == "lu":
        *batch, rows, _ = _shape(equation.invars[0])
        return Operations(arithmetic=math.prod(batch) * 2.0 / 3.0 * rows**3)
    if name == "triangular_solve":
        return Operations(arithmetic=float(results * _shape(equation.invars[0])[-1]))
    return Operations()  # what moves or names values


def _programs_in(parameters: dict[str, Any]) -> Iterator[core.Jaxpr]:
    """Programs within an equation; of a linear solve that knows its derivatives, the solving alone."""
    if "jaxprs" in parameters:
        parameters = {"solve": parameters["jaxprs"].solve}
    for value in parameters.values():
        for part in value if isinstance(value, tuple | list) else (value,):
            if isinstance(part, core.ClosedJaxpr):
                yield part.jaxpr
            elif isinstance(part, core.Jaxpr):
                yield part


def _size(variable: Any) -> int:
    return math.prod(_shape(variable))


def _shape(variable: Any) -> tuple[int, ...]:
    return variable.aval.shape
