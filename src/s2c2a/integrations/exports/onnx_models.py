"""Export form `onnx`: parts of a trained strategy as ONNX models.

`jax2onnx` converts the operations; it takes them as a jaxpr (`plain_jaxpr`), so that
none of JAX's functions is replaced while they are traced.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import s2c2a
from s2c2a.arm import arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.files import atomic_write
from s2c2a.integrations.control_step import ControlStep, StepInput, StepMemory
from s2c2a.integrations.exports.c_source import strategy_in
from s2c2a.integrations.exports.plain_jaxpr import plain_function
from s2c2a.integrations.extras import needs_extra
from s2c2a.strategies.strategy import Strategy


class Part(NamedTuple):
    """A function of a strategy that becomes a model.

    Attributes:
        ending: of its file, such as ".start.onnx".
        function: of named pytrees of arrays; returns a dictionary of them.
        inputs: an example, by the name of each pytree.
    """

    ending: str
    function: Callable[..., dict[str, Any]]
    inputs: dict[str, Any]


def export_onnx(file: Path, out: Path) -> str:
    """Write the parts of a weight file as ONNX models.

    Args:
        file: weights, such as mine.safetensors.
        out: the model of the control step, such as mine.onnx; beside it lie
            mine.start.onnx, mine.forward_model.onnx and mine.controller.onnx.

    Returns:
        What was written.

    Raises:
        S2C2AError: no weight file, or a part of the strategy cannot be exported.
    """
    strategy = strategy_in(file)
    texts = {
        "arm": arm_to_toml(strategy.arm),
        "origin": f"{file.name}, S2C2A {s2c2a.__version__}",
    }
    models = [(part, onnx_of(part, texts)) for part in parts_of(strategy)]
    for part, model in models:
        with atomic_write(out.with_suffix(part.ending)) as partial_file:
            partial_file.write_bytes(model)
    endings = ", ".join(part.ending for part, _ in models)
    return f"{len(models)} models ({endings})"


def parts_of(strategy: Strategy) -> list[Part]:
    """The functions that are exported, with examples of an arm at rest."""
    control = ControlStep.of(strategy)
    example = control.example()
    memory = jax.jit(control.start)(example.measured)
    model, controller = control.planner.model, control.controller
    sensed = jnp.asarray(memory.estimate.configuration)

    def step(memory: StepMemory, input: StepInput) -> dict[str, Any]:
        command, after = control.step(memory, input)
        return {"command": command, "memory": after}

    def predict(configurations: Any, hysteresis: Any) -> dict[str, Any]:
        return {
            "states": model.predict(configurations, hysteresis),
            "hysteresis": model.observe(configurations, hysteresis),
        }

    def act(desired: Any, sensed: Any, memory: Any) -> dict[str, Any]:
        command, after = controller.act(desired, sensed, memory)
        return {"command": command, "memory": after}

    def start(measured: Any) -> dict[str, Any]:
        return {"memory": control.start(measured)}

    hysteresis = model.start(sensed)
    acting = {"desired": sensed, "sensed": sensed, "memory": controller.start(sensed)}
    return [
        Part(".onnx", step, {"memory": memory, "input": example}),
        Part(".start.onnx", start, {"measured": example.measured}),
        Part(
            ".forward_model.onnx",
            predict,
            {"configurations": sensed, "hysteresis": hysteresis},
        ),
        Part(".controller.onnx", act, acting),
    ]


def onnx_of(part: Part, texts: dict[str, str]) -> bytes:
    """The model of a part.

    Inputs and outputs are named by their path, such as `input_goal_positions`.

    Args:
        part: function and example.
        texts: metadata of the model.

    Raises:
        S2C2AError: jax2onnx is missing, or does not know an operation.
    """
    with needs_extra("onnx", "an export to ONNX"):
        from jax2onnx import to_onnx  # noqa: PLC0415  # an extra
    leaves, structure = jax.tree.flatten(part.inputs)
    arrays = [np.asarray(leaf) for leaf in leaves]

    def flat(*values: Any) -> tuple:
        results = part.function(**jax.tree.unflatten(structure, values))
        return tuple(jax.tree.leaves(results))

    closed = jax.make_jaxpr(flat)(*arrays)
    distinct = list(dict.fromkeys(map(id, closed.jaxpr.outvars)))
    places = [distinct.index(id(variable)) for variable in closed.jaxpr.outvars]
    plain = plain_function(closed)
    shapes = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in arrays]
    results = jax.eval_shape(lambda: part.function(**part.inputs))
    name = f"s2c2a{part.ending.removesuffix('.onnx').replace('.', '_') or '_step'}"
    try:
        model = to_onnx(
            lambda *values: _distinct(plain(*values), places),
            shapes,
            model_name=name,
            input_names=names_of(part.inputs),
        )
    except NotImplementedError as error:
        raise S2C2AError(
            f"{part.ending} cannot be exported: {error}; --to c may know the operation"
        ) from error
    _name_outputs(model, names_of(results, suffix="_out"), places)
    for key, text in texts.items():
        model.metadata_props.add(key=key, value=text)
    return model.SerializeToString()


def _distinct(results: list[Any], places: list[int]) -> tuple:
    """Each result once: ONNX does not return a value under two names."""
    return tuple(results[places.index(place)] for place in range(max(places) + 1))


def _name_outputs(model: Any, names: list[str], places: list[int]) -> None:
    """Name the outputs; equal ones are copies."""
    from onnx import helper  # noqa: PLC0415  # an extra

    found = list(model.graph.output)
    del model.graph.output[:]
    for name, place in zip(names, places, strict=True):
        node = helper.make_node("Identity", [found[place].name], [name])
        model.graph.node.append(node)
        output = model.graph.output.add()
        output.CopyFrom(found[place])
        output.name = name


def names_of(tree: Any, suffix: str = "") -> list[str]:
    """Names of the arrays of nested structures, by their paths."""
    paths = jax.tree_util.tree_flatten_with_path(tree)[0]
    names = [
        jax.tree_util.keystr(path, simple=True, separator="_") for path, _ in paths
    ]
    return [f"{name}{suffix}" for name in names]
