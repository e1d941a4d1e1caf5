"""From a jaxpr to statements of a program."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.elementwise import cost_of, element_of
from s2c2a.integrations.c_code.jaxprs import (
    described,
    folded,
    inner_call,
    needed_equations,
    simplified,
)
from s2c2a.integrations.c_code.program import Program, constant, kind_of
from s2c2a.integrations.c_code.values import Computed, Indices, Place, Value

MAX_COST = 40  # operations of one expression; compilers take long over larger ones

Rule = Callable[["Writer", JaxprEqn, list[Value]], Sequence[Value]]
RULES: dict[str, Rule] = {}
"""How operations on whole arrays are written, by the name of the primitive."""


def rule(*names: str) -> Callable[[Rule], Rule]:
    """Register a function as the rule of primitives."""

    def register(function: Rule) -> Rule:
        RULES.update(dict.fromkeys(names, function))
        return function

    return register


@dataclass
class Scope:
    """Values of the variables of one jaxpr, and how often each is still read."""

    values: dict[Var, Value | np.ndarray] = field(default_factory=dict)
    uses: Counter = field(default_factory=Counter)


class Writer:
    """Writes jaxprs into a program.

    Attributes:
        program: that is written.
    """

    def __init__(self, program: Program):
        """Nothing is written yet."""
        self.program = program
        self._protected: list[frozenset[Place]] = []

    def write(
        self,
        jaxpr: Jaxpr,
        constants: Sequence[Any],
        inputs: Sequence[Value | np.ndarray],
        needed: Sequence[bool] | None = None,
    ) -> list[Value | np.ndarray]:
        """Write all operations of a jaxpr; returns its outputs.

        Args:
            jaxpr: operations.
            constants: arrays of its constant variables.
            inputs: of its other variables.
            needed: which outputs are used; the others may be anything.
        """
        wanted = [True] * len(jaxpr.outvars) if needed is None else list(needed)
        equations = needed_equations(jaxpr, wanted)
        scope = Scope()
        read = [variable for equation, _ in equations for variable in equation.invars]
        for variable, want in zip(jaxpr.outvars, wanted, strict=True):
            if want:
                read.append(variable)
        scope.uses.update(each for each in read if isinstance(each, Var))
        for variable, array in zip(jaxpr.constvars, constants, strict=True):
            scope.values[variable] = _known(array)
        for variable, value in zip(jaxpr.invars, inputs, strict=True):
            scope.values[variable] = self._kept(value, scope.uses[variable])
        with self.protecting(inputs):
            for equation, is_used in equations:
                self._write_equation(equation, is_used, scope)
        return [
            self._read(variable, scope)
            if is_needed
            else np.zeros(described(variable).shape)
            for variable, is_needed in zip(jaxpr.outvars, wanted, strict=True)
        ]

    def write_closed(
        self, closed: ClosedJaxpr, inputs: Sequence[Value | np.ndarray]
    ) -> list[Value]:
        """Write a jaxpr with its constants; returns its outputs as values."""
        outputs = self.write(closed.jaxpr, closed.consts, inputs)
        return [self.value(output) for output in outputs]

    def value(self, known: Value | np.ndarray) -> Value:
        """A value that code can read."""
        if not isinstance(known, np.ndarray):
            return known
        if known.size and (known == known.flat[0]).all():
            number = constant(known.flat[0], kind_of(known.dtype))
            return number.broadcast(known.shape, ())
        return self.program.constants.stored(known)

    @contextmanager
    def protecting(self, values: Iterable[Value | np.ndarray]) -> Iterator[None]:
        """Keep the places of values while the block writes other operations."""
        self._protected.append(self._reads(values))
        try:
            yield
        finally:
            self._protected.pop()

    def _write_equation(
        self, equation: JaxprEqn, is_used: list[bool], scope: Scope
    ) -> None:
        operands = [self._read(variable, scope) for variable in equation.invars]
        for variable in equation.invars:
            if isinstance(variable, Var):
                scope.uses[variable] -= 1
        outputs = self._outputs(equation, is_used, operands, scope)
        for variable, output in zip(equation.outvars, outputs, strict=True):
            scope.values[variable] = self._kept(output, scope.uses[variable])
        for variable in equation.invars:
            if isinstance(variable, Var) and not scope.uses[variable]:
                scope.values.pop(variable, None)
        live = self._reads(scope.values.values()).union(*self._protected)
        self.program.free_all_but(live)

    def _outputs(
        self,
        equation: JaxprEqn,
        is_used: list[bool],
        operands: list[Value | np.ndarray],
        scope: Scope,
    ) -> Sequence[Value | np.ndarray]:
        name = equation.primitive.name
        if (call := inner_call(equation, operands)) is not None:
            inner, given = call
            with self.protecting(scope.values.values()):
                return self.write(inner.jaxpr, inner.consts, given, is_used)
        if (results := folded(equation, operands)) is not None:
            return [_known(result) for result in results]
        if (simple := simplified(equation, operands)) is not None:
            return [simple]
        values = [self.value(operand) for operand in operands]
        if name in RULES:
            with self.protecting([*scope.values.values(), *values]):
                return RULES[name](self, equation, values)
        dtypes = [described(variable).dtype for variable in equation.invars]
        element = element_of(name, equation.params, dtypes)
        if element is None:
            raise S2C2AError(
                f"the operation '{name}' cannot be exported to C; choose another recipe"
            )

        def at(indices: Indices) -> str:
            return element(*(broadcast_at(value, indices) for value in values))

        output = described(equation.outvars[0])
        cost = cost_of(name) + sum(value.cost for value in values)
        kind = kind_of(output.dtype)
        places = self._reads(values)
        return [Computed(kind, output.shape, at, cost=cost, places=places)]

    def _kept(self, value: Value | np.ndarray, uses: int) -> Value | np.ndarray:
        """The value as later operations read it: stored if computed too often."""
        if not isinstance(value, Computed) or not value.cost:
            return value
        if uses > 1 or value.cost > MAX_COST:
            return self.program.stored(value)
        return value

    def _read(self, variable: Any, scope: Scope) -> Value | np.ndarray:
        if isinstance(variable, Literal):
            return _known(variable.val)
        return scope.values[variable]

    def _reads(self, values: Iterable[Value | np.ndarray]) -> frozenset[Place]:
        places = [value.places for value in values if not isinstance(value, np.ndarray)]
        return frozenset().union(*places)


def _known(array: Any) -> np.ndarray:
    values = np.asarray(array)
    is_float = np.issubdtype(values.dtype, np.floating)
    return values.astype(np.float32) if is_float else values


def broadcast_at(value: Value, indices: Indices) -> str:
    """An element of a value that is broadcast to more elements."""
    if not value.shape:
        return value.at(())
    pairs = zip(indices, value.shape, strict=True)
    return value.at(tuple("0" if size == 1 else index for index, size in pairs))
