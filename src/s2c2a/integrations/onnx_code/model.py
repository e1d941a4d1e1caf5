"""An ONNX model of a function of named arrays."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from onnx.numpy_helper import from_array

from s2c2a.integrations.onnx_code import (  # noqa: F401  # they register their rules
    control_rules,
    rules,
)
from s2c2a.integrations.onnx_code.graph import Graph, Tensor, described_value, helper
from s2c2a.integrations.onnx_code.writer import GraphWriter

OPSET = 20  # ONNX 1.15; runtimes of 2024 read it
IR_VERSION = 9  # of ONNX 1.15


class Port(NamedTuple):
    """An input or output of a model.

    Attributes:
        name: in the model.
        about: what it is, with its unit.
        default: value of an input that may be left out.
    """

    name: str
    about: str = ""
    default: np.ndarray | None = None


def model_of(
    name: str,
    function: Callable[..., Sequence[Any]],
    examples: Sequence[np.ndarray],
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    about: str,
    texts: Mapping[str, str],
) -> bytes:
    """Write a function as a model.

    Args:
        name: of the graph.
        function: of arrays; returns arrays.
        examples: arrays of the right types and shapes.
        inputs: their names.
        outputs: names of the results.
        about: what the model does.
        texts: metadata.

    Raises:
        S2C2AError: an operation has no rule, or the extra is missing.
    """
    closed = jax.make_jaxpr(function)(*examples)
    graph = Graph()
    given = [
        Tensor(port.name, array.dtype, array.shape, array.shape)
        for port, array in zip(inputs, examples, strict=True)
    ]
    writer = GraphWriter(graph)
    results = writer.write_closed(closed, given)
    named = []
    for port, result in zip(outputs, results, strict=True):
        node = helper.make_node("Identity", [writer.full(result)], [port.name])
        graph.nodes.append(node)
        named.append(described_value(port.name, result.dtype, result.shape, port.about))
    defaults = [
        from_array(port.default, port.name)
        for port in inputs
        if port.default is not None
    ]
    known = [
        described_value(tensor.name, tensor.dtype, tensor.shape, port.about)
        for port, tensor in zip(inputs, given, strict=True)
    ]
    proto = helper.make_graph(
        graph.nodes, name, known, named, [*graph.initializers, *defaults], about
    )
    model = helper.make_model(
        proto,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="s2c2a",
        doc_string=about,
    )
    helper.set_model_props(model, dict(texts))
    return model.SerializeToString()
