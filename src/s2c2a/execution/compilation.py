"""JIT compilation with shared programs: arrays become inputs, not constants.

A jitted function that closes over trained weights compiles them into the program, so
each network pays seconds for a program of its own. Here arrays are inputs: one program
serves all networks of one shape. The persistent compilation cache of JAX
(`jax_compilation_cache_dir`) then serves all of them too.

`equinox.filter_jit` does the same, but takes modules and arrays apart in every call, in
Python. With the shipped networks of `twin_arm`, on one core, a control step takes 2.0 ms
with it and 1.6 ms with `compiled`, which takes them apart once.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.execution import executables

EMITTERS = "xla_cpu_use_fusion_emitters"
"""Option of XLA, without which `best` compiles in half the time, and its steps are as fast.
Networks of the paper's kind compile no faster, and their plans take a tenth longer."""
MAX_UNROLLED = 8  # steps of `scan`; longer sequences compile faster as loops
MAPS = Path("/proc/self/maps")  # Linux only
MAX_MAPS = 20_000
"""Memory maps of a process from which it forgets its compiled programs: a third of the
65,530 that Linux allows."""


def compiled(function: Callable[..., Any], *parts: Any) -> Callable[..., Any]:
    """Return `function(*parts, *inputs)` as a compiled function of the inputs.

    The first call with inputs of certain shapes compiles it, or takes it from disk
    (`executables`).

    Args:
        function: a module-level function, or otherwise an object whose identity does
            not change between calls.
        parts: pytrees. Their arrays are inputs of the program; all other leaves must be
            hashable and are constants of the program.
    """
    leaves, structure = jax.tree.flatten(parts)
    arrays, constants = eqx.partition(tuple(leaves), _is_array)
    kinds = tuple(type(constant) for constant in constants)
    return partial(_program(function, structure, constants, kinds), arrays)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray)


@lru_cache  # as many as by default: 128
def _program(
    function: Callable[..., Any], structure: Any, constants: tuple, kinds: tuple
) -> "_Program":
    """The program, shared by equal arguments.

    `kinds` keeps 1, 1.0 and True apart, which compare equal in Python.
    """

    def run(arrays, *inputs):
        parts = structure.unflatten(eqx.combine(arrays, constants))
        return function(*parts, *inputs)

    # profiles and compilation logs show this name
    run.__name__ = getattr(function, "__name__", "run")
    return _Program(run, (function, structure, constants, kinds))


class _Program:
    """A function of arrays, compiled once for each kind of inputs.

    A call tries the last executable, which refuses inputs of other shapes; this costs
    as much as a call of `jax.jit`.
    """

    def __init__(self, run: Callable[..., Any], description: tuple):
        """Compile nothing yet.

        Args:
            run: function of arrays.
            description: what it follows from.
        """
        self._jitted = jax.jit(run)
        self._description = description
        self._executables: dict[Any, Callable[..., Any]] = {}
        self._last: Callable[..., Any] | None = None

    def __call__(self, *inputs: Any) -> Any:
        if last := self._last:
            with suppress(TypeError, ValueError):  # of other shapes, or traced
                return last(*inputs)
        leaves, structure = jax.tree.flatten(inputs)
        if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
            return self._jitted(*inputs)
        kinds = tuple((np.shape(leaf), str(jnp.result_type(leaf))) for leaf in leaves)
        if program := self._executables.get((structure, kinds)):
            result = program(*inputs)
        else:
            program, result = self._made(structure, kinds, inputs)
            self._executables[structure, kinds] = program
        self._last = program
        return result

    def _made(self, structure: Any, kinds: tuple, inputs: tuple) -> tuple[Any, Any]:
        """The executable for these inputs, from disk if it is there, and its result."""
        options = {EMITTERS: "BiLSTM" in str(self._description[1])}
        place = executables.place_of(self._description, structure, kinds, options)
        if kept := executables.load(place, inputs):
            return kept
        program = executables.made(place, self._jitted.lower(*inputs), options)
        return program, program(*inputs)


def forget_programs(max_maps: int = MAX_MAPS) -> bool:
    """Forget compiled programs if they occupy too much of a limited resource.

    Those of strategies that are in use stay.

    Every program occupies several memory maps, and Linux allows 65,530 for each process
    (`vm.max_map_count`). A worker that makes many networks and runs would exceed that.

    Args:
        max_maps: number of memory maps from which programs are forgotten.

    Returns:
        Whether they were forgotten.
    """
    if not MAPS.exists() or MAPS.read_bytes().count(b"\n") < max_maps:
        return False
    _program.cache_clear()
    jax.clear_caches()
    return True


def scan(
    step: Callable[[Any, Array], tuple[Any, Array]],
    state: Any,
    values: Float[Array, "*batch steps features"],
    reverse: bool = False,
) -> Float[Array, "*batch steps outputs"]:
    """Return the outputs of `state, output = step(state, value)` along the last axis but one.

    A short sequence is unrolled here: `jax.lax.scan` moves axes, and unrolled by itself
    made gradients of networks slower by a tenth.

    Args:
        step: from state and value to the next state and an output.
        state: before the first step.
        values: one for each step.
        reverse: whether the last value is the first step; outputs stay in the order of
            the values.
    """
    if values.shape[-2] > MAX_UNROLLED:
        rows = jnp.moveaxis(values, -2, 0)
        _, stacked = jax.lax.scan(step, state, rows, reverse=reverse)
        return jnp.moveaxis(stacked, 0, -2)
    order = range(values.shape[-2])
    outputs: dict[int, Array] = {}
    for index in reversed(order) if reverse else order:
        state, outputs[index] = step(state, values[..., index, :])
    return jnp.stack([outputs[index] for index in order], axis=-2)


def select_if_finite(new: Any, old: Any) -> Any:
    """Return the new pytree if all its numbers are finite, otherwise the old one."""
    return select(all_finite(new), new, old)


def select(condition: Bool[Array, ""], new: Any, old: Any) -> Any:
    """Return one of two pytrees."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)


def all_finite(values: Any) -> Bool[Array, ""]:
    """Return whether all numbers of a pytree are finite."""
    finite = [jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(values)]
    return jnp.all(jnp.array(finite, dtype=bool))
