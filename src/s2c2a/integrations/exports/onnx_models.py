"""Export form `onnx`: control step, forward model and controller as ONNX models.

Every model is compared with JAX, in ONNX Runtime, before it is written.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import s2c2a
from s2c2a.arm import ArmGeometry, ArmSpec, arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.files.text import atomic_write
from s2c2a.goals import Goal
from s2c2a.integrations.control_step import ControlStep, StepInput
from s2c2a.integrations.exports.c_source import strategy_in
from s2c2a.integrations.extras import needs_extra
from s2c2a.kinematics import configurations_from_bends
from s2c2a.runtime.border import named_errors
from s2c2a.strategies.strategy import Strategy

SAMPLES = 20  # inputs at which a model is compared
EQUAL = 1e-3  # of the largest number of an output; small changes lose digits
DECIDED = 2  # steps whose decision may hang on the last bits; see docs/guides/export.md
CHANGE = 0.2  # chosen: of the bends that the arm holds, between two compared steps
AT_REST = "start"
STEP = "control_step"
RETURNED = "_out"  # behind the name of an output that is the next input
UNITS = {
    "command": "command of every cable [m or N], base first",
    "states": "position [m] and axis of every module's end, base frame",
    "configurations": "configuration of every module, base first",
    "desired": "desired configuration of every module, base first",
    "sensed": "sensed configuration of every module, base first",
    "hysteresis": "memory of the forward model; its output is the next input",
    "memory": "memory; its output is the next input",
    "measured_cables": "displacements of the cables [m]",
    "measured_configurations": "configuration of every module, base first",
    "measurements": "of this sensor, SI units; NaN where it is missing",
    "goal_positions": "desired ends of the modules [m], base frame",
    "goal_axes": "desired axes of the modules, base frame",
    "goal_obstacles": "centers of obstacles [m], base frame",
    "goal_thresholds": "distance from obstacles [m]; 0 in rows that are not used",
    "goal_beyond": "position [m] and axis; NaN: not known",
    "goal_preview": "positions [m] and axes of the next moments; NaN: not known",
    "goal_shape": "desired bends [rad]",
}
"""What arrays are, by the beginning of their names; the longest counts."""


class Part(NamedTuple):
    """A function of a strategy that becomes a model.

    Attributes:
        name: of the part, in the name of its file.
        about: what it does.
        function: of named pytrees of arrays; returns a dictionary of them.
        inputs: an example, by the name of each pytree.
        sampled: random number generator -> inputs that are compared one after another;
            what is missing is that of the last result, or of the example.
        optional: names of the inputs that may be left out.
        decided: how many compared samples may differ.
    """

    name: str
    about: str
    function: Callable[..., dict[str, Any]]
    inputs: dict[str, Any]
    sampled: Callable[[np.random.Generator], Iterator[dict[str, Any]]]
    optional: tuple[str, ...] = ()
    decided: int = 0


def export_onnx(file: Path, out: Path) -> str:
    """Write control step, forward model and controller of weights as ONNX models.

    Args:
        file: weights, such as mine.safetensors.
        out: begins their names: mine.onnx stands for mine.start.onnx,
            mine.control_step.onnx, mine.forward_model.onnx and mine.controller.onnx.

    Returns:
        What was written.

    Raises:
        S2C2AError: no weight file, the extra is missing, or a model cannot be converted
            or differs from JAX; the others are written.
    """
    strategy = strategy_in(file)
    with needs_extra("onnx", "an export to ONNX"):
        import onnx  # noqa: F401, PLC0415  # an extra
        import onnxruntime  # noqa: F401, PLC0415  # an extra

    texts = {
        "arm": arm_to_toml(strategy.arm),
        "control_period": f"{strategy.arm.control_period:g}",
        "origin": f"{file.name}, S2C2A {s2c2a.__version__}",
    }
    written, faults = [], []
    for part in parts_of(strategy):
        try:
            with named_errors(S2C2AError, "it cannot be written"):
                _write(part, texts, out)
        except S2C2AError as error:
            faults.append(f"{part.name}: {error}")
        else:
            written.append(part.name)
    if faults:
        raise S2C2AError(
            f"these models were not written: {'; '.join(faults)}. "
            f"Written: {', '.join(written) or 'none'}"
        )
    return f"models {', '.join(written)}"


def _write(part: Part, texts: dict[str, str], out: Path) -> None:
    model = onnx_of(part, texts)
    check_model(part, model)
    path = out.with_suffix(f".{part.name}.onnx")
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(model)


def parts_of(strategy: Strategy) -> list[Part]:
    """The functions that are exported, with examples of a straight arm at rest."""
    return [*step_parts(strategy), *_model_parts(strategy)]


def step_parts(strategy: Strategy) -> list[Part]:
    """The control step, and the function that gives its first memory."""
    control = ControlStep.of(strategy)
    example = control.example()
    inputs = example._asdict()
    arm = strategy.arm

    def begin(measured: Any) -> dict[str, Any]:
        return {"memory": control.start(measured)}

    def go_on(memory: Any, **inputs: Any) -> dict[str, Any]:
        command, after = control.step(memory, StepInput(**inputs))
        return {"command": command, "memory": after}

    def readings(random: np.random.Generator) -> Iterator[dict[str, Any]]:
        for each in _steps(arm, example, random):
            yield {"measured": each.measured}

    def steps(random: np.random.Generator) -> Iterator[dict[str, Any]]:
        for each in _steps(arm, example, random):
            yield each._asdict()

    about = (
        f"Control step of the arm {arm.name}, every {arm.control_period:g} s: from "
        "memory, measurements and goal to the command within the limits of the arm. Not "
        "in it: ways around obstacles, checks of sensors, emergency stop."
    )
    memory = jax.tree.map(np.asarray, jax.jit(control.start)(example.measured))
    rest = f"Memory of the control step from the first reading of {arm.name} at rest."
    optional = "measurements", "goal"
    return [
        Part(AT_REST, rest, begin, {"measured": example.measured}, readings),
        Part(
            STEP, about, go_on, {"memory": memory, **inputs}, steps, optional, DECIDED
        ),
    ]


def _steps(
    arm: ArmSpec, example: StepInput, random: np.random.Generator
) -> Iterator[StepInput]:
    """Inputs of an arm that bends from sample to sample, with one target."""
    geometry = ArmGeometry.of(arm)
    limits = geometry.planned_bends[:, None]
    bends = np.zeros((len(limits), 2))
    target = random.normal(size=3) + np.array([0.0, 0.0, 2.0])
    target *= 0.8 * arm.length / np.linalg.norm(target)
    goal = Goal.of(arm.module_count).with_position(target)
    goal = goal.with_obstacles([target / 2], [arm.length / 12])
    while True:
        bends += CHANGE * random.uniform(-1.0, 1.0, bends.shape) * limits
        bends = np.clip(bends, -0.5 * limits, 0.5 * limits)
        cables = np.einsum("mck,mk->mc", geometry.cable_matrices, bends)
        known = {
            "cables": cables * geometry.cable_radii[:, None],
            "configurations": configurations_from_bends(jnp.asarray(bends)),
        }
        measured = {
            name: np.asarray(known[name], np.float32) for name in example.measured
        }
        yield example._replace(measured=measured, goal=goal)


def _model_parts(strategy: Strategy) -> list[Part]:
    model, controller = strategy.planner.model, strategy.controller
    limits = ArmGeometry.of(strategy.arm).planned_bends[:, None]
    straight = configurations_from_bends(jnp.zeros((len(limits), 2)))

    def predict(configurations: Any, hysteresis: Any) -> dict[str, Any]:
        return {
            "states": model.predict(configurations, hysteresis),
            "hysteresis": model.observe(configurations, hysteresis),
        }

    def act(desired: Any, sensed: Any, memory: Any) -> dict[str, Any]:
        command, after = controller.act(desired, sensed, memory)
        return {"command": command, "memory": after}

    def drawn(*names: str) -> Callable[[np.random.Generator], Iterator[dict[str, Any]]]:
        def samples(random: np.random.Generator) -> Iterator[dict[str, Any]]:
            while True:
                yield {name: _configurations(limits, random) for name in names}

        return samples

    at_rest = {"configurations": straight, "hysteresis": model.start(straight)}
    memory = controller.start(straight)
    acting = {"desired": straight, "sensed": straight, "memory": memory}
    predicts = "States that configurations lead to."
    acts = "Command from desired and sensed configurations, without limits."
    return [
        Part("forward_model", predicts, predict, at_rest, drawn("configurations")),
        Part("controller", acts, act, acting, drawn("desired", "sensed")),
    ]


def _configurations(limits: np.ndarray, random: np.random.Generator) -> Any:
    bends = random.uniform(-0.5, 0.5, (len(limits), 2)) * limits
    return configurations_from_bends(jnp.asarray(bends, jnp.float32))


def onnx_of(part: Part, texts: dict[str, str]) -> bytes:
    """The model of a part.

    Inputs and outputs are named by their path, such as `memory_inner_actions`; outputs
    that are the next input have `_out` behind it, for names are unique.

    Args:
        part: function and example.
        texts: metadata of the model.

    Raises:
        S2C2AError: the extra is missing, or an operation has no rule.
    """
    with needs_extra("onnx", "an export to ONNX"):
        from s2c2a.integrations.onnx_code.model import (  # noqa: PLC0415  # an extra
            Port,
            model_of,
        )

    leaves, structure = jax.tree.flatten(part.inputs)
    arrays = [np.asarray(leaf) for leaf in leaves]

    def flat(*values: Any) -> list[Any]:
        results = part.function(**jax.tree.unflatten(structure, values))
        return jax.tree.leaves(results)

    results = jax.eval_shape(lambda given: part.function(**given), part.inputs)
    names = names_of(part.inputs)
    inputs = [
        Port(name, _about(name), array if name.startswith(part.optional) else None)
        for name, array in zip(names, arrays, strict=True)
    ]
    outputs = [
        Port(f"{name}{RETURNED}" if name in names else name, _about(name))
        for name in names_of(results)
    ]
    name = f"s2c2a_{part.name}"
    return model_of(name, flat, arrays, inputs, outputs, part.about, texts)


def _about(name: str) -> str:
    known = [begin for begin in UNITS if name.startswith(begin)]
    return UNITS[max(known, key=len)] if known else ""


def check_model(part: Part, model: bytes) -> None:
    """Compare a model with JAX at random inputs, each with the next memory.

    Raises:
        S2C2AError: they differ.
    """
    run = runner(model)
    names = names_of(part.inputs)
    function = jax.jit(part.function)
    inputs = part.inputs
    samples = part.sampled(np.random.default_rng(0))
    differences, sizes = [], []
    for _ in range(SAMPLES):
        inputs = inputs | next(samples)
        arrays = [np.asarray(leaf) for leaf in jax.tree.leaves(inputs)]
        found = run(dict(zip(names, arrays, strict=True)))
        results = function(**inputs)
        pairs = zip(jax.tree.leaves(results), found, strict=True)
        compared = [_difference(np.asarray(ours), theirs) for ours, theirs in pairs]
        differences.append([difference for difference, _ in compared])
        sizes.append([size for _, size in compared])
        inputs = {name: results.get(name, value) for name, value in inputs.items()}
    scales = np.maximum(np.max(sizes, axis=0), EQUAL)
    largest = np.max(np.array(differences) / scales, axis=1)
    if np.sum(~(largest < EQUAL)) > part.decided:
        raise S2C2AError(
            f"the ONNX model of the {part.name} differs from JAX by "
            f"{largest.max():.1e} of its numbers. Use --to c"
        )


def runner(model: bytes) -> Callable[[dict[str, np.ndarray]], list[np.ndarray]]:
    """The function of a model in ONNX Runtime, on one core.

    Raises:
        S2C2AError: the extra is missing.
    """
    with needs_extra("onnx", "an export to ONNX"):
        import onnxruntime  # noqa: PLC0415  # an extra

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3  # errors; else it warns about optimizations
    options.intra_op_num_threads = 1  # arrays are small
    session = onnxruntime.InferenceSession(model, options)
    return lambda inputs: session.run(None, inputs)


def _difference(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """Largest difference, and the largest number."""
    if ours.shape != theirs.shape or (np.isnan(ours) != np.isnan(theirs)).any():
        return np.inf, 0.0
    ours, theirs = ours.astype(float), theirs.astype(float)
    equal = (ours == theirs) | np.isnan(ours)
    difference = np.abs(np.where(equal, 0.0, ours - theirs)).max(initial=0.0)
    finite = np.where(np.isfinite(ours), ours, 0.0)
    return float(difference), float(np.abs(finite).max(initial=0.0))


def names_of(tree: Any) -> list[str]:
    """Names of the arrays of nested structures, by their paths."""
    paths = jax.tree_util.tree_flatten_with_path(tree)[0]
    keystr = jax.tree_util.keystr
    return [keystr(path, simple=True, separator="_") for path, _ in paths]
