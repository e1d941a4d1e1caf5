"""Number of programs that JAX compiles."""

from jax import monitoring

EVENT = "/jax/core/compile/backend_compile_duration"
_count = [0]


def compilations() -> int:
    """Number of programs compiled, or read from the cache, since the import."""
    return _count[0]


def _count_compilation(event: str, duration_secs: float, **_: str | int) -> None:
    if event == EVENT:
        _count[0] += 1


monitoring.register_event_duration_secs_listener(_count_compilation)
