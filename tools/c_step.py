"""Compare exported control steps in C with JAX, in value and time.

    python -m tools.c_step shipped        # networks of the package for twin_arm
    python -m tools.c_step mine.safetensors --steps 1000

The steps are recorded first: a strategy drives a simulated arm to random targets, some
with axes and obstacles. Then both compute every step from the same memory and input.
"""

import argparse
import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from s2c2a.goals import Goal
from s2c2a.integrations.c_code.interface import Field, Generated, Layout, fields_of
from s2c2a.integrations.control_step import ControlStep, StepInput
from s2c2a.integrations.exports.c_source import c_of, strategy_in
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime.limits import CommandLimiter, CommandLimits
from s2c2a.strategies.strategy import Strategy

STRICT = ["-std=c99", "-pedantic-errors", "-Wall", "-Wextra", "-Werror"]
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
FAST = ("-O3", "-march=native")
CHANGE_EVERY = 60  # steps between two goals
EQUAL = 1e-4  # of the range of the commands
ROUNDING = 6e-8  # of a number in single precision


class CProgram:
    """A compiled control step, and its memory."""

    def __init__(
        self,
        generated: Generated,
        name: str,
        folder: Path,
        example: Any,
        flags: tuple[str, ...] = ("-O1",),
    ):
        """Compile it, with all warnings as errors.

        Args:
            generated: its text.
            name: prefix in C.
            folder: for the files.
            example: an input.
            flags: for the compiler.
        """
        (folder / f"{name}.h").write_text(generated.header, encoding="utf-8")
        source = folder / f"{name}.c"
        source.write_text(generated.source, encoding="utf-8")
        library = folder / f"{name}.so"
        files = [*STRICT, *flags, "-shared", "-fPIC", str(source), "-o", str(library)]
        subprocess.run([str(COMPILER), *files, "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))
        self._name = name
        self._fields = fields_of(example)
        members = [(field.name, _type_of(field)) for field in self._fields]
        self._input = type("Input", (ctypes.Structure,), {"_fields_": members})()
        self._memory = np.zeros(generated.memory_bytes // 4 + 1, np.float32)
        self._call("clear", ctypes.byref(self._input))

    def given(self, name: str) -> np.ndarray:
        """A member of the input."""
        return np.array(getattr(self._input, name))

    def start(self, inputs: Any) -> bool:
        """Begin at rest; whether the input is sound."""
        self._put(inputs)
        arguments = self._pointer(self._memory), ctypes.byref(self._input)
        return bool(self._call("start", *arguments))

    def step(self, inputs: Any, shape: tuple[int, ...]) -> np.ndarray:
        """The output of the next step; `is_sound` and `seconds` are of it."""
        self._put(inputs)
        command = np.full(shape, np.nan, np.float32)
        arguments = self._pointer(self._memory), ctypes.byref(self._input)
        began = time.perf_counter()
        self.is_sound = bool(self._call("step", *arguments, self._pointer(command)))
        self.seconds = time.perf_counter() - began
        return command

    def remember(self, memory: Any) -> None:
        """Set the memory to that of JAX."""
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(memory)]
        layout = Layout.of(leaves)
        floats = [leaf.ravel() for leaf in leaves if leaf.dtype.kind == "f"]
        integers = [leaf.ravel() for leaf in leaves if leaf.dtype.kind != "f"]
        words = self._memory.view(np.int32)
        now = np.concatenate(floats)
        self._memory[: len(now)] = now
        if integers:
            numbers = np.concatenate(integers).astype(np.int32)
            first = 2 * layout.floats
            words[first : first + len(numbers)] = numbers
        words[-1] = 0

    def _put(self, inputs: Any) -> None:
        for field, leaf in zip(self._fields, jax.tree.leaves(inputs), strict=True):
            kind = np.float32 if field.kind == "float" else np.int32
            values = np.ascontiguousarray(leaf, kind)
            offset = getattr(type(self._input), field.name).offset
            place = ctypes.addressof(self._input) + offset
            ctypes.memmove(place, values.ctypes.data, values.nbytes)

    def _call(self, name: str, *arguments: Any) -> Any:
        return getattr(self._library, f"{self._name}_{name}")(*arguments)

    @staticmethod
    def _pointer(array: np.ndarray) -> ctypes.c_void_p:
        return array.ctypes.data_as(ctypes.c_void_p)


def _type_of(field: Field) -> Any:
    kind = ctypes.c_float if field.kind == "float" else ctypes.c_int32
    for size in reversed(field.shape):
        kind = kind * size
    return kind


class Comparison(NamedTuple):
    """Differences of commands in C from those of JAX, and times.

    Attributes:
        differences: largest of every step, in parts of the range of the commands.
        rounding: how much the command of JAX changes by the last bits of its memory,
            in the steps that differ by more than `EQUAL`, by their number.
        seconds_c: of every step.
        seconds_jax: of every step.
    """

    differences: np.ndarray
    rounding: dict[int, float]
    seconds_c: np.ndarray
    seconds_jax: np.ndarray


def random_goals(arm: Any, steps: int) -> Iterator[Goal]:
    """Targets within reach, one for some time; some with an axis or an obstacle."""
    random = np.random.default_rng(0)
    goal = Goal.of(arm.module_count)
    for step in range(steps):
        if step % CHANGE_EVERY == 0:
            direction = random.normal(size=3)
            direction[2] = abs(direction[2]) + 1.0
            direction *= arm.length / np.linalg.norm(direction)
            share = random.uniform(0.7, 0.95)
            goal = Goal.of(arm.module_count).with_position(share * direction)
        if step % (3 * CHANGE_EVERY) == CHANGE_EVERY:
            goal = goal.with_obstacles([direction / 2], [arm.length / 12])
        if step % CHANGE_EVERY == CHANGE_EVERY // 2:
            goal = goal.with_axis(random.normal(size=3))
        yield goal


def recorded_inputs(
    strategy: Strategy, control: ControlStep, steps: int
) -> tuple[list[StepInput], np.ndarray]:
    """Inputs of the control steps of a simulated run, and the commands sent."""
    robot = SimulatedRobot(strategy.arm, seed=1)
    limiter = CommandLimiter(CommandLimits.of(strategy.arm))
    example = control.example()
    reading = robot.open()
    strategy.start(reading)
    inputs, sent = [], []
    for goal in random_goals(strategy.arm, steps):
        measured = {
            name: np.asarray(reading[name], np.float32) for name in example.measured
        }
        inputs.append(example._replace(measured=measured, goal=goal))
        command = limiter.limit(strategy.step(reading, goal))
        strategy.sent(command)
        sent.append(command)
        robot.step(command)
        reading = robot.read()
    return inputs, np.array(sent)


def compare(
    strategy: Strategy, folder: Path, steps: int, flags: tuple[str, ...] = FAST
) -> Comparison:
    """Compute recorded steps in C and in JAX, each from the memory of JAX."""
    control = ControlStep(strategy)
    inputs, sent = recorded_inputs(strategy, control, steps)
    scale = float(np.ptp(sent))
    generated = c_of(strategy, "step", "compared")
    program = CProgram(generated, "step", folder, inputs[0], flags)
    step = jax.jit(control.step)
    memory = jax.jit(control.start)(inputs[0].measured)
    program.start(inputs[0])
    differences, rounding, times = [], {}, []
    jax.block_until_ready(step(memory, inputs[0]))
    for number, each in enumerate(inputs):
        program.remember(memory)
        began = time.perf_counter()
        command, after = jax.block_until_ready(step(memory, each))
        seconds = time.perf_counter() - began
        found = program.step(each, command.shape)
        times.append((program.seconds, seconds))
        differences.append(_distance(found, command) / scale)
        if differences[-1] > EQUAL:
            changes = [
                _distance(step(_rounded(memory, seed), each)[0], command)
                for seed in range(30)
            ]
            rounding[number] = max(changes) / scale
        memory = after
    seconds_c, seconds_jax = np.array(times).T
    return Comparison(np.array(differences), rounding, seconds_c, seconds_jax)


def _distance(left: Any, right: Any) -> float:
    return float(np.abs(np.asarray(left) - np.asarray(right)).max())


def _rounded(memory: Any, seed: int) -> Any:
    """The memory, its numbers changed by half of the last bit at most."""
    random = np.random.default_rng(seed)

    def changed(leaf: Any) -> np.ndarray:
        values = np.asarray(leaf)
        if values.dtype.kind != "f":
            return values
        factors = 1.0 + ROUNDING * random.uniform(-1.0, 1.0, values.shape)
        return (values * factors).astype(np.float32)

    return jax.tree.map(changed, memory)


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("weights")
    parser.add_argument("--steps", type=int, default=1000)
    given = parser.parse_args()
    strategy = strategy_in(Path(given.weights))
    with tempfile.TemporaryDirectory() as folder:
        result = compare(strategy, Path(folder), given.steps)
    largest = np.sort(result.differences)[::-1]
    print(f"{len(largest)} steps; difference in parts of the range of the commands:")
    print(f"median {np.median(largest):.1e}, largest {largest[:5]}")
    for number, change in result.rounding.items():
        print(
            f"step {number}: {result.differences[number]:.1e}; JAX itself differs by "
            f"{change:.1e} if the last bits of its memory differ"
        )
    c, jax_time = 1e3 * np.median(result.seconds_c), 1e3 * np.median(result.seconds_jax)
    print(f"median time: C {c:.2f} ms, JAX {jax_time:.2f} ms, ratio {c / jax_time:.2f}")


if __name__ == "__main__":
    main()
