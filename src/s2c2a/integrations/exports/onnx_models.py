"""Export form `onnx`: forward model and controller of a trained strategy as ONNX models.

`jax2onnx` converts the operations; it takes them as a jaxpr (`plain_jaxpr`), so that
none of JAX's functions is replaced while they are traced. Every model is compared with
JAX before it is written.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun

import s2c2a
from s2c2a.arm import ArmGeometry, arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.files import atomic_write
from s2c2a.integrations.exports.c_source import strategy_in
from s2c2a.integrations.exports.plain_jaxpr import plain_function
from s2c2a.integrations.extras import needs_extra
from s2c2a.kinematics import configurations_from_bends
from s2c2a.strategies.strategy import Strategy

SAMPLES = 20  # random bends at which a model is compared
EQUAL = 1e-4  # of the largest number of an output


class Part(NamedTuple):
    """A function of a strategy that becomes a model.

    Attributes:
        name: of the part, in the name of its file.
        function: of named pytrees of arrays; returns a dictionary of them.
        inputs: an example, by the name of each pytree.
        configurations: names of the inputs that are configurations.
    """

    name: str
    function: Callable[..., dict[str, Any]]
    inputs: dict[str, Any]
    configurations: tuple[str, ...]


def export_onnx(file: Path, out: Path) -> str:
    """Write forward model and controller of a weight file as ONNX models.

    Args:
        file: weights, such as mine.safetensors.
        out: begins their names: mine.onnx stands for mine.forward_model.onnx and
            mine.controller.onnx.

    Returns:
        What was written.

    Raises:
        S2C2AError: no weight file, the extra is missing, or a model cannot be converted
            or differs from JAX; then nothing is written.
    """
    strategy = strategy_in(file)
    texts = {
        "arm": arm_to_toml(strategy.arm),
        "origin": f"{file.name}, S2C2A {s2c2a.__version__}",
    }
    parts = parts_of(strategy)
    models = [onnx_of(part, texts) for part in parts]
    for part, model in zip(parts, models, strict=True):
        check_model(part, model, strategy)
    for part, model in zip(parts, models, strict=True):
        path = out.with_suffix(f".{part.name}.onnx")
        with atomic_write(path) as unfinished:
            unfinished.write_bytes(model)
    return f"models {' and '.join(part.name for part in parts)}"


def parts_of(strategy: Strategy) -> list[Part]:
    """The functions that are exported, with examples of a straight arm at rest."""
    model, controller = strategy.planner.model, strategy.controller
    bends = jnp.zeros((strategy.arm.module_count, 2))
    straight = configurations_from_bends(bends)

    def predict(configurations: Any, hysteresis: Any) -> dict[str, Any]:
        return {
            "states": model.predict(configurations, hysteresis),
            "hysteresis": model.observe(configurations, hysteresis),
        }

    def act(desired: Any, sensed: Any, memory: Any) -> dict[str, Any]:
        command, after = controller.act(desired, sensed, memory)
        return {"command": command, "memory": after}

    at_rest = {"configurations": straight, "hysteresis": model.start(straight)}
    memory = controller.start(straight)
    acting = {"desired": straight, "sensed": straight, "memory": memory}
    return [
        Part("forward_model", predict, at_rest, ("configurations",)),
        Part("controller", act, acting, ("desired", "sensed")),
    ]


def onnx_of(part: Part, texts: dict[str, str]) -> bytes:
    """The model of a part.

    Inputs are named by their path, such as `memory_inner_actions`, and outputs with
    `_out` behind it.

    Args:
        part: function and example.
        texts: metadata of the model.

    Raises:
        S2C2AError: jax2onnx is missing, or does not know an operation.
    """
    leaves, structure = jax.tree.flatten(part.inputs)
    arrays = [np.asarray(leaf) for leaf in leaves]

    def flat(*values: Any) -> tuple:
        results = part.function(**jax.tree.unflatten(structure, values))
        return tuple(jax.tree.leaves(results))

    closed = jax.make_jaxpr(flat)(*arrays)
    distinct = list(dict.fromkeys(map(id, closed.jaxpr.outvars)))
    places = [distinct.index(id(variable)) for variable in closed.jaxpr.outvars]
    # traced before the conversion, which replaces functions of JAX
    plain = jaxpr_as_fun(jax.make_jaxpr(plain_function(closed))(*arrays))
    shapes = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in arrays]
    try:
        with needs_extra("onnx", "an export to ONNX"), restored(jax.numpy, jax.lax):
            from jax2onnx import to_onnx  # noqa: PLC0415  # an extra

            model = to_onnx(
                lambda *values: _distinct(plain(*values), places),
                shapes,
                model_name=f"s2c2a_{part.name}",
                input_names=names_of(part.inputs),
            )
    except NotImplementedError as error:
        raise S2C2AError(
            f"the {part.name} cannot be exported to ONNX: {error}; --to c may know the "
            "operation"
        ) from error
    results = jax.eval_shape(lambda: part.function(**part.inputs))
    _name_outputs(model, names_of(results, suffix="_out"), places)
    for key, text in texts.items():
        model.metadata_props.add(key=key, value=text)
    return model.SerializeToString()


@contextmanager
def restored(*modules: Any) -> Iterator[None]:
    """Undo what the block replaces in modules; jax2onnx leaves functions of its own."""
    before = [(module, dict(vars(module))) for module in modules]
    try:
        yield
    finally:
        for module, names in before:
            vars(module).update(names)


def check_model(part: Part, model: bytes, strategy: Strategy) -> None:
    """Compare a model with JAX at random configurations, each with the next memory.

    Raises:
        S2C2AError: they differ.
    """
    import onnxruntime  # noqa: PLC0415  # jax2onnx needs it

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3  # errors; else it warns about optimizations
    session = onnxruntime.InferenceSession(model, options)
    names = names_of(part.inputs)
    limits = ArmGeometry.of(strategy.arm).planned_bends
    random = np.random.default_rng(0)
    inputs = part.inputs
    for _ in range(SAMPLES):
        for name in part.configurations:
            bends = random.uniform(-0.5, 0.5, (len(limits), 2)) * limits[:, None]
            drawn = configurations_from_bends(jnp.asarray(bends, jnp.float32))
            inputs = inputs | {name: drawn}
        arrays = [np.asarray(leaf) for leaf in jax.tree.leaves(inputs)]
        found = session.run(None, dict(zip(names, arrays, strict=True)))
        results = part.function(**inputs)
        for ours, theirs in zip(jax.tree.leaves(results), found, strict=True):
            _check_equal(part, np.asarray(ours), theirs)
        inputs = {name: results.get(name, value) for name, value in inputs.items()}


def _check_equal(part: Part, ours: np.ndarray, theirs: np.ndarray) -> None:
    scale = max(float(np.abs(ours).max(initial=0.0)), EQUAL)
    if not np.allclose(ours, theirs, rtol=0.0, atol=EQUAL * scale, equal_nan=True):
        raise S2C2AError(
            f"the ONNX model of the {part.name} differs from JAX by "
            f"{np.abs(ours - theirs).max():.1e}; nothing was written. Use --to c"
        )


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
