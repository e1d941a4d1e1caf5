"""The biLSTMs of the paper as graphs of ONNX."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from onnx import TensorProto, helper
from onnx.numpy_helper import from_array

from s2c2a.arm import ArmSpec
from s2c2a.models import C2A, C2S
from s2c2a.models.layers import SumAndRange
from s2c2a.paper import BiLSTM, module_labels
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY

OPSET = 20  # ONNX 1.15; runtimes of 2024 read it
IR_VERSION = 9  # of ONNX 1.15
GATES = (0, 3, 1, 2)
"""Input, output, forget, cell: the order of ONNX in that of `paper.Direction`."""
UNITS = {
    "configurations": "configuration of every module, base first",
    "states": "position [m] and axis of every module's end, base frame",
    "desired": "desired configuration of every module, base first",
    "sensed": "sensed configuration of every module, base first",
    "command": "command of every cable [m or N], base first",
    "memory_configurations": "memory; its output is the next input",
    "memory_actions": "memory; its output is the next input",
}
"""What inputs and outputs are, by their names without `_out`."""


class Graph:
    """Nodes, constants, inputs and outputs of a model, as they are added."""

    def __init__(self, about: str):
        """An empty graph.

        Args:
            about: what the model does.
        """
        self._about = about
        self._nodes: list[Any] = []
        self._constants: list[Any] = []
        self._inputs: list[Any] = []
        self._outputs: list[Any] = []

    def input(self, name: str, shape: Sequence[int]) -> str:
        """Add an input of numbers."""
        self._inputs.append(_port(name, shape))
        return name

    def output(self, name: str, value: str, shape: Sequence[int]) -> None:
        """Name a value as an output."""
        self._nodes.append(helper.make_node("Identity", [value], [name]))
        self._outputs.append(_port(name, shape))

    def constant(self, values: Any) -> str:
        """Add an array, in single precision unless it holds integers."""
        array = np.asarray(values)
        kind = np.int64 if array.dtype.kind == "i" else np.float32
        name = f"constant{len(self._constants)}"
        tensor = from_array(np.asarray(array, kind), name)
        self._constants.append(tensor)
        return name

    def add(self, kind: str, *inputs: str, **attributes: Any) -> str:
        """Add an operation; returns its first output."""
        name = f"value{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def model(self, name: str, texts: dict[str, str]) -> bytes:
        """The model.

        Args:
            name: of the graph.
            texts: metadata.
        """
        graph = helper.make_graph(
            self._nodes,
            name,
            self._inputs,
            self._outputs,
            self._constants,
            self._about,
        )
        model = helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", OPSET)],
            ir_version=IR_VERSION,
            producer_name="s2c2a",
            doc_string=self._about,
        )
        helper.set_model_props(model, texts)
        return model.SerializeToString()


def _port(name: str, shape: Sequence[int]) -> Any:
    """An input or output, with what it is."""
    about = UNITS[name.removesuffix("_out")]
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape, about)


def forward_graph(model: C2S, arm: ArmSpec) -> Graph:
    """States that configurations lead to."""
    graph = Graph("States that configurations lead to.")
    given = graph.input("configurations", (arm.module_count, 3))
    scaling = model.configuration_scaling
    centered = graph.add("Sub", given, graph.constant(scaling.center))
    scaled = graph.add("Div", centered, graph.constant(scaling.half_range))
    raw = add_network(graph, model.network, scaled, arm.module_count)
    scaling = model.state_scaling
    stretched = graph.add("Mul", raw, graph.constant(scaling.half_range))
    states = graph.add("Add", stretched, graph.constant(scaling.center))
    graph.output("states", states, (arm.module_count, 6))
    return graph


def controller_graph(model: C2A, arm: ArmSpec) -> Graph:
    """Command from desired and sensed configurations, as `NetworkController.act`."""
    graph = Graph(
        "Command from desired and sensed configurations, without integral correction "
        "and limits of its change."
    )
    modules = arm.module_count
    cables = arm.cable_count
    desired = graph.input("desired", (modules, 3))
    sensed = graph.input("sensed", (modules, 3))
    past_shape = (modules, CONFIGURATION_HISTORY, 3)
    past = graph.input("memory_configurations", past_shape)
    actions_shape = (modules, ACTION_HISTORY, cables)
    past_actions = graph.input("memory_actions", actions_shape)

    history = add_pushed(graph, past, sensed, CONFIGURATION_HISTORY)
    all_configurations = add_pushed(graph, history, desired, CONFIGURATION_HISTORY + 1)
    scaling = model.configuration_scaling
    centered = graph.add("Sub", all_configurations, graph.constant(scaling.center))
    scaled = graph.add("Div", centered, graph.constant(scaling.half_range))
    flat = graph.constant([modules, -1])
    features = graph.add(
        "Concat",
        graph.add("Reshape", scaled, flat),
        graph.add("Reshape", past_actions, flat),
        graph.constant(module_labels(modules)[:, None]),
        axis=1,
    )
    raw = add_network(graph, model.network, features, modules)
    command, normalized = add_sum_and_range(graph, model.sum_and_range, raw)
    actions = add_pushed(graph, past_actions, normalized, ACTION_HISTORY)
    graph.output("command", command, (modules, cables))
    graph.output("memory_configurations_out", history, past_shape)
    graph.output("memory_actions_out", actions, actions_shape)
    return graph


def add_network(graph: Graph, network: BiLSTM, features: str, modules: int) -> str:
    """Add layers along the modules, and the linear head (`paper.BiLSTM`)."""
    batch_axis = graph.constant([1])
    values = graph.add("Unsqueeze", features, batch_axis)  # (modules, 1, features)
    for layer in network.layers:
        hidden = len(layer[0].weight_hidden)

        def gates(weights: jax.Array, hidden: int = hidden) -> np.ndarray:
            blocks = np.asarray(weights).T.reshape(4, hidden, -1)
            return blocks[list(GATES)].reshape(4 * hidden, -1)

        biases = [gates(each.bias)[:, 0] for each in layer]
        outputs = graph.add(
            "LSTM",
            values,
            graph.constant(np.stack([gates(each.weight_input) for each in layer])),
            graph.constant(np.stack([gates(each.weight_hidden) for each in layer])),
            graph.constant(np.pad(np.stack(biases), ((0, 0), (0, 4 * hidden)))),
            hidden_size=hidden,
            direction="bidirectional",
        )  # (modules, 2, 1, hidden)
        width = graph.constant([modules, 1, 2 * hidden])
        values = graph.add("Reshape", outputs, width)
    values = graph.add("Squeeze", values, batch_axis)
    head = graph.constant(network.weight_head)
    return graph.add("Gemm", values, head, graph.constant(network.bias_head))


def add_pushed(graph: Graph, history: str, newest: str, length: int) -> str:
    """Add a row in front of a history, of which `length` rows remain (`paper.pushed`)."""
    row = graph.add("Unsqueeze", newest, graph.constant([1]))
    longer = graph.add("Concat", row, history, axis=1)
    first, last, axis = [graph.constant([number]) for number in (0, length, 1)]
    return graph.add("Slice", longer, first, last, axis)


def add_sum_and_range(graph: Graph, layer: SumAndRange, raw: str) -> tuple[str, str]:
    """Add the last layer; returns the command [m or N] and the normalized one."""
    inverses = graph.constant(layer.pseudo_inverses)
    matrices = graph.constant(layer.matrices)

    def bends_of(cables: str) -> str:
        return graph.add("Einsum", inverses, cables, equation="mkc,mc->mk")

    def cables_of(bends: str) -> str:
        return graph.add("Einsum", matrices, bends, equation="mck,mk->mc")

    if layer.evenly_three:
        weights = 3.0 * np.eye(3) - np.ones((3, 3))
        mixing = graph.constant(weights / 4.0)
        normalized = graph.add("MatMul", graph.add("Tanh", raw), mixing)
    else:
        bends = bends_of(raw)
        axis = graph.constant([1])
        square = graph.add("ReduceSumSquare", bends, axis)
        smallest = graph.constant(np.float32(1e-12))  # tanh(x) / x is one before it
        length = graph.add("Sqrt", graph.add("Max", square, smallest))
        factor = graph.add("Div", graph.add("Tanh", length), length)
        normalized = cables_of(graph.add("Mul", bends, factor))
    neutral = graph.constant(layer.neutral)
    unit = graph.constant(layer.unit)
    low = graph.constant(layer.low)
    command = graph.add("Add", neutral, graph.add("Mul", normalized, unit))
    if layer.balance is not None:
        # as `arm.geometry.raised`
        balance = np.asarray(layer.balance)
        is_used = balance > 0.0
        shares = np.where(is_used, 1.0 / np.where(is_used, balance, 1.0), 0)
        missing = graph.add("Sub", low, command)
        missing = graph.add("Mul", missing, graph.constant(shares))
        largest = graph.add("ReduceMax", missing, graph.constant([1]))
        part = graph.add("Mul", graph.add("Relu", largest), graph.constant(balance))
        command = graph.add("Add", command, part)
    command = graph.add("Max", command, low)
    command = graph.add("Min", command, graph.constant(layer.high))
    sent = graph.add("Div", graph.add("Sub", command, neutral), unit)
    if layer.balance is not None:
        sent = cables_of(bends_of(sent))
    return command, sent
