"""Compiled programs, shared by all that differs in numbers alone.

A function that closes over trained weights has them compiled into it: every network then pays seconds for a program of
its own. Here arrays go in as inputs, so one program serves all networks of one shape, and what JAX keeps on disk
(`jax_compilation_cache_dir`) serves them too.
"""

from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Any

import jax
import numpy as np

MOST_PROGRAMS = 128


def compiled(function: Callable[..., Any], *parts: Any) -> Callable[..., Any]:
    """`function(*parts, *inputs)` as a compiled function of the inputs; it compiles when first called.

    Args:
        function: of a module, or otherwise the same object for the same work.
        parts: pytrees; arrays in them are inputs of the program, everything else is hashable and built into it.
    """
    leaves, structure = jax.tree.flatten(parts)
    held = [_is_array(leaf) for leaf in leaves]
    arrays = tuple(leaf for leaf, array in zip(leaves, held, strict=True) if array)
    built_in = tuple(None if array else leaf for leaf, array in zip(leaves, held, strict=True))
    program = _program(function, structure, built_in, tuple(held))
    return lambda *inputs: program(arrays, *inputs)


@lru_cache(MOST_PROGRAMS)
def _program(function: Callable[..., Any], structure: Hashable, built_in: tuple, held: tuple[bool, ...]):
    def run(arrays, *inputs):
        given = iter(arrays)
        leaves = [next(given) if array else leaf for array, leaf in zip(held, built_in, strict=True)]
        return function(*jax.tree.unflatten(structure, leaves), *inputs)

    run.__name__ = getattr(function, "__name__", "run")  # what profiles and logs of compilations show
    return jax.jit(run)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray)
