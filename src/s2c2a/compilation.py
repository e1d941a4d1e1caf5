"""Compiled programs, shared by all that differs in numbers alone.

A function that closes over trained weights has them compiled into it: every network
then pays seconds for a program of its own. Here arrays go in as inputs, so one program
serves all networks of one shape, and what JAX keeps on disk
(`jax_compilation_cache_dir`) serves them too.
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
_COMPILING = "/jax/core/compile/backend_compile_duration"
_compiled = [0]


def compilations() -> int:
    """How many programs this process has compiled, or fetched from those kept, since this module was imported."""
    return _compiled[0]


def _heard(event: str, duration_secs: float, **_: str | int) -> None:
    if event == _COMPILING:
        _compiled[0] += 1


monitoring.register_event_duration_secs_listener(_heard)


def compiled(function: Callable[..., Any], *parts: Any) -> Callable[..., Any]:
    """`function(*parts, *inputs)` as a compiled function of the inputs; it compiles when first called.

    Args:
        function: of a module, or otherwise the same object for the same work.
        parts: pytrees; arrays in them are inputs of the program, everything else is
            hashable and built into it.
    """
    leaves, structure = jax.tree.flatten(parts)
    kinds = tuple(
        _ARRAY if isinstance(leaf, jax.Array | np.ndarray) else type(leaf)
        for leaf in leaves
    )
    arrays = tuple(
        leaf for leaf, kind in zip(leaves, kinds, strict=True) if kind is _ARRAY
    )
    built_in = tuple(
        None if kind is _ARRAY else leaf
        for leaf, kind in zip(leaves, kinds, strict=True)
    )
    program = _program(function, structure, built_in, kinds)
    return lambda *inputs: program(arrays, *inputs)


@lru_cache(MAX_PROGRAMS)
def _program(
    function: Callable[..., Any], structure: Hashable, built_in: tuple, kinds: tuple
):
    """One for all that is equal; kinds tell 1, 1.0 and True apart, which Python calls equal."""

    def run(arrays, *inputs):
        given = iter(arrays)
        leaves = [
            next(given) if kind is _ARRAY else leaf
            for kind, leaf in zip(kinds, built_in, strict=True)
        ]
        return function(*jax.tree.unflatten(structure, leaves), *inputs)

    # what profiles and logs of compilations show
    run.__name__ = getattr(function, "__name__", "run")
    return jax.jit(run)


def where_finite(new: Any, old: Any) -> Any:
    """The new pytree, or the old one where anything in the new one is not finite."""
    sound = jnp.all(
        jnp.array(
            [jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(new)], dtype=bool
        )
    )
    return jax.tree.map(lambda one, other: jnp.where(sound, one, other), new, old)
