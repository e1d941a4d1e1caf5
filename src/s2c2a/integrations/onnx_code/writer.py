"""From a jaxpr to the nodes of a graph."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

from s2c2a.errors import S2C2AError
from s2c2a.integrations.jaxprs import (
    UNCHANGED,
    described,
    folded,
    inner_call,
    needed_equations,
    simplified,
)
from s2c2a.integrations.onnx_code.decompositions import DECOMPOSITIONS
from s2c2a.integrations.onnx_code.graph import Graph, Operand, Operands, Shape, Tensor

Rule = Callable[["GraphWriter", JaxprEqn, Operands], Sequence[Operand]]
RULES: dict[str, Rule] = {}
"""How operations are written, by the name of the primitive."""


def rule(*names: str) -> Callable[[Rule], Rule]:
    """Register a function as the rule of primitives."""

    def register(function: Rule) -> Rule:
        RULES.update(dict.fromkeys(names, function))
        return function

    return register


class GraphWriter:
    """Writes jaxprs into a graph.

    Attributes:
        graph: that is written.
    """

    def __init__(self, graph: Graph):
        """Nothing is written yet."""
        self.graph = graph

    def write(
        self,
        jaxpr: Jaxpr,
        constants: Sequence[Any],
        inputs: Sequence[Operand],
        needed: Sequence[bool] | None = None,
    ) -> Operands:
        """Write all operations of a jaxpr; returns its outputs.

        Args:
            jaxpr: operations.
            constants: arrays of its constant variables.
            inputs: of its other variables.
            needed: which outputs are used; the others may be anything.
        """
        wanted = [True] * len(jaxpr.outvars) if needed is None else list(needed)
        known = map(np.asarray, constants)
        values: dict[Var, Operand] = {}
        values.update(zip(jaxpr.constvars, known, strict=True))
        values.update(zip(jaxpr.invars, inputs, strict=True))
        for equation, is_used in needed_equations(jaxpr, wanted):
            operands = [_read(variable, values) for variable in equation.invars]
            outputs = self._outputs(equation, is_used, operands)
            values.update(zip(equation.outvars, outputs, strict=True))
        results = []
        for variable, want in zip(jaxpr.outvars, wanted, strict=True):
            result = _read(variable, values) if want else _anything(variable)
            results.append(result)
        return results

    def write_closed(self, closed: ClosedJaxpr, inputs: Sequence[Operand]) -> Operands:
        """Write a jaxpr with its constants; returns its outputs."""
        return self.write(closed.jaxpr, closed.consts, inputs)

    def traced(self, function: Callable[..., Any], *inputs: Operand) -> Operands:
        """Write a function of JAX arrays."""
        shapes = [jax.ShapeDtypeStruct(each.shape, each.dtype) for each in inputs]
        closed = jax.make_jaxpr(function)(*shapes)
        return self.write_closed(closed, inputs)

    def value(self, operand: Operand) -> Tensor:
        """The operand in the graph, equal numbers as one."""
        if isinstance(operand, Tensor):
            return operand
        array = _one_of_equal(operand)
        name = self.graph.constant(array)
        return Tensor(name, operand.dtype, operand.shape, array.shape)

    def full(self, operand: Operand) -> str:
        """Name of the operand with all its elements."""
        if isinstance(operand, np.ndarray):
            return self.graph.constant(operand)
        if operand.held == operand.shape:
            return operand.name
        shape = self.graph.integers(*operand.shape)
        return self.graph.node("Expand", operand.name, shape)

    def reshaped(self, operand: Operand, shape: Shape, held: Shape) -> Tensor:
        """The same elements in another shape."""
        value = self.value(operand)
        if value.held == held:
            return Tensor(value.name, value.dtype, shape, held)
        sizes = self.graph.integers(*held)
        name = self.graph.node("Reshape", value.name, sizes)
        return Tensor(name, value.dtype, shape, held)

    def elementwise(self, operation: str, equation: Any, operands: Any) -> Tensor:
        """A node that broadcasts its inputs."""
        values = [self.value(operand) for operand in operands]
        names = [value.name for value in values]
        shapes = [value.held for value in values]
        name = self.graph.node(operation, *names)
        held = np.broadcast_shapes(*shapes)
        output = described(equation.outvars[0])
        return Tensor(name, np.dtype(output.dtype), output.shape, held)

    def _outputs(
        self, equation: JaxprEqn, is_used: list[bool], operands: Operands
    ) -> Sequence[Operand]:
        call = inner_call(equation, operands)
        if call is not None:
            inner, given = call
            return self.write(inner.jaxpr, inner.consts, given, is_used)
        results = folded(equation, operands)
        if results is not None:
            return results
        avals = [described(variable) for variable in equation.outvars]
        if not any(aval.size for aval in avals):
            return [np.zeros(aval.shape, aval.dtype) for aval in avals]
        simple = simplified(equation, operands)
        if simple is not None:
            return [simple]
        return self._written(equation, operands)

    def _written(self, equation: JaxprEqn, operands: Operands) -> Sequence[Operand]:
        """Results of an operation that needs nodes."""
        name = equation.primitive.name
        if name in UNCHANGED:
            return operands
        if name in RULES:
            return RULES[name](self, equation, operands)
        if name in DECOMPOSITIONS:
            function = DECOMPOSITIONS[name](equation.params)
            return self.traced(function, *operands)
        raise S2C2AError(
            f"the operation '{name}' cannot be exported to ONNX; choose another recipe, "
            "or export to c"
        )


def _one_of_equal(array: np.ndarray) -> np.ndarray:
    """One number instead of equal ones."""
    if not array.size:
        return array
    first = array.flat[:1]
    is_equal = (array == first).all()
    is_nan = array.dtype.kind == "f" and np.isnan(array).all()
    return first.reshape(()) if is_equal or is_nan else array


def _anything(variable: Any) -> np.ndarray:
    """The value of an output that nothing reads."""
    aval = described(variable)
    return np.zeros(aval.shape)


def result_of(equation: Any, name: str, number: int = 0) -> Tensor:
    """A result with all its elements."""
    aval = described(equation.outvars[number])
    return Tensor(name, np.dtype(aval.dtype), aval.shape, aval.shape)


def results_of(equation: Any, names: Sequence[str]) -> list[Tensor]:
    """All results, each with all its elements."""
    return [result_of(equation, name, number) for number, name in enumerate(names)]


def _read(variable: Any, values: dict[Var, Operand]) -> Operand:
    if isinstance(variable, Literal):
        return np.asarray(variable.val, described(variable).dtype)
    return values[variable]
