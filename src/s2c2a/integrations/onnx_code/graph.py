"""Nodes, constants and bodies of an ONNX graph."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from s2c2a.integrations.extras import needs_extra

with needs_extra("onnx", "an export to ONNX"):
    from onnx import GraphProto, NodeProto, TensorProto, ValueInfoProto, helper
    from onnx.numpy_helper import from_array

Shape = tuple[int, ...]


@dataclass(frozen=True)
class Tensor:
    """A value of the graph.

    Attributes:
        name: in the graph.
        dtype: of its elements.
        shape: that JAX knows.
        held: shape of the array in the graph, which broadcasts to `shape`: operations
            on single elements need no repeated numbers.
    """

    name: str
    dtype: np.dtype
    shape: Shape
    held: Shape

    @property
    def size(self) -> int:
        """Number of elements."""
        return int(np.prod(self.shape))

    @property
    def padded(self) -> Shape:
        """The held shape with as many axes as the shape."""
        return (1,) * (len(self.shape) - len(self.held)) + self.held


Operand = Tensor | np.ndarray
"""A value of the graph, or an array that is known while the graph is written."""
Operands = list[Operand]


@dataclass
class Graph:
    """A graph that grows; its bodies of loops and branches read all its values."""

    nodes: list[NodeProto] = field(default_factory=list)
    initializers: list[TensorProto] = field(default_factory=list)
    _constants: dict[tuple, str] = field(default_factory=dict)
    _names: int = 0

    def new_name(self) -> str:
        """A name that nothing has yet."""
        self._names += 1
        return f"v{self._names}"

    def constant(self, values: np.ndarray) -> str:
        """Name of an array that never changes."""
        array = np.ascontiguousarray(values).reshape(np.shape(values))
        key = array.dtype.str, array.shape, array.tobytes()
        if key not in self._constants:
            name = self.new_name()
            self.initializers.append(from_array(array, name))
            self._constants[key] = name
        return self._constants[key]

    def integers(self, *numbers: Any) -> str:
        """Name of constant sizes, axes or indices."""
        return self.constant(np.array(numbers, np.int64))

    def node(self, operation: str, *inputs: str, **attributes: Any) -> str:
        """Add a node of one output; returns its name."""
        return self.nodes_of(operation, inputs, 1, **attributes)[0]

    def nodes_of(
        self, operation: str, inputs: Sequence[str], count: int, **attributes: Any
    ) -> list[str]:
        """Add a node; returns the names of its outputs."""
        outputs = [self.new_name() for _ in range(count)]
        self.nodes.append(helper.make_node(operation, inputs, outputs, **attributes))
        return outputs

    @contextmanager
    def body(self) -> Iterator["Body"]:
        """Collect the nodes of the block in a graph of their own, for an attribute."""
        outer = self.nodes
        self.nodes = []
        body = Body(self)
        try:
            yield body
            body.nodes = self.nodes
        finally:
            self.nodes = outer


@dataclass
class Body:
    """A graph inside a node."""

    graph: Graph
    inputs: list[ValueInfoProto] = field(default_factory=list)
    outputs: list[ValueInfoProto] = field(default_factory=list)
    nodes: list[NodeProto] = field(default_factory=list)

    def input(self, dtype: Any, shape: Shape) -> Tensor:
        """A new input."""
        name = self.graph.new_name()
        self.inputs.append(described_value(name, dtype, shape))
        return Tensor(name, np.dtype(dtype), shape, shape)

    def output(self, name: str, dtype: Any, shape: Shape) -> None:
        """Return a value: under a name of its own, for it may be an input."""
        self.outputs.append(
            described_value(self.graph.node("Identity", name), dtype, shape)
        )

    def proto(self) -> GraphProto:
        """The graph, after its block."""
        name = self.graph.new_name()
        return helper.make_graph(self.nodes, name, self.inputs, self.outputs)


def described_value(
    name: str, dtype: Any, shape: Shape, about: str = ""
) -> ValueInfoProto:
    """Name, type and shape of an input or output."""
    return helper.make_tensor_value_info(name, element_type(dtype), shape, about)


def element_type(dtype: Any) -> int:
    """The number of a type in ONNX."""
    return helper.np_dtype_to_tensor_dtype(np.dtype(dtype))
