"""JIT compilation with shared programs: arrays become inputs, not constants.

A jitted function that closes over trained weights compiles them into the program, so
each network pays seconds for a program of its own. Here arrays are inputs: one program
serves all networks of one shape. The persistent compilation cache of JAX
(`jax_compilation_cache_dir`) then serves all of them too.
"""

from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import monitoring

MAX_PROGRAMS = 128
_ARRAY = "array"
_COMPILATION_EVENT = "/jax/core/compile/backend_compile_duration"
_compilation_count = [0]


def compilations() -> int:
    """Number of programs compiled, or read from the cache, since the import."""
    return _compilation_count[0]


def _count_compilation(event: str, duration_secs: float, **_: str | int) -> None:
    if event == _COMPILATION_EVENT:
        _compilation_count[0] += 1


monitoring.register_event_duration_secs_listener(_count_compilation)


def compiled(function: Callable[..., Any], *parts: Any) -> Callable[..., Any]:
    """Return `function(*parts, *inputs)` as a jitted function of the inputs.

    The first call compiles it.

    Args:
        function: a module-level function, or otherwise an object whose identity does
            not change between calls.
        parts: pytrees. Their arrays are inputs of the program; all other leaves must be
            hashable and are constants of the program.
    """
    leaves, structure = jax.tree.flatten(parts)
    kinds: list[Any] = []
    arrays: list[Any] = []
    constants: list[Any] = []
    for leaf in leaves:
        if isinstance(leaf, jax.Array | np.ndarray):
            kinds.append(_ARRAY)
            arrays.append(leaf)
            constants.append(None)
        else:
            kinds.append(type(leaf))
            constants.append(leaf)
    program = _program(function, structure, tuple(constants), tuple(kinds))
    array_inputs = tuple(arrays)
    return lambda *inputs: program(array_inputs, *inputs)


@lru_cache(MAX_PROGRAMS)
def _program(
    function: Callable[..., Any], structure: Hashable, constants: tuple, kinds: tuple
):
    """Jitted function, shared by equal arguments.

    `kinds` keeps 1, 1.0 and True apart, which compare equal in Python.
    """

    def run(arrays, *inputs):
        remaining = iter(arrays)
        leaves = [
            next(remaining) if kind is _ARRAY else constant
            for kind, constant in zip(kinds, constants, strict=True)
        ]
        return function(*jax.tree.unflatten(structure, leaves), *inputs)

    # profiles and compilation logs show this name
    run.__name__ = getattr(function, "__name__", "run")
    return jax.jit(run)


def select_if_finite(new: Any, old: Any) -> Any:
    """Return the new pytree if all its numbers are finite, otherwise the old one."""
    finite = [jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(new)]
    all_finite = jnp.all(jnp.array(finite, dtype=bool))
    return jax.tree.map(lambda a, b: jnp.where(all_finite, a, b), new, old)
