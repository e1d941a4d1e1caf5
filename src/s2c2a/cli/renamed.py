"""Words of the command line that were others in version 0.1: one clear error each, for one release."""

from collections.abc import Sequence

from s2c2a.errors import S2C2AError

_PARTS = (
    "startup",
    "plan",
    "batch",
    "step",
    "profile",
    "jitter",
    "collect",
    "training",
    "simulation",
    "rods",
    "growth",
)
_FLAGS = (
    "seed",
    "repeats",
    "long-repeats",
    "ticks",
    "memory-ticks",
    "device",
    "quick",
    "whole-torch",
    "overwrite",
)
_BENCHMARKS = "benchmarks stand beside the package: in a clone of s2c2a, say"
GONE = {
    "bench": {
        part: f"{_BENCHMARKS} `pytest benchmarks/bench_{part}.py`" for part in _PARTS
    }
    | {
        f"--{flag}": f"{_BENCHMARKS} `make bench` (benchmarks/README.md has its options)"
        for flag in _FLAGS
    },
    "reproduce": {"rod": f"{_BENCHMARKS} `python benchmarks/simulator_accuracy.py`"},
    "bench-live": {"": f"{_BENCHMARKS} `pytest benchmarks/bench_live.py`"},
}
"""Verb -> word, nothing for the verb itself -> what to do."""


def check_renamed(arguments: Sequence[str]) -> None:
    """Raise S2C2AError where a word is given that is gone, or an option by its old name."""
    verb, *words = arguments or [""]
    flags = [word.partition("=")[0] for word in words]
    if verb == "run" and "--controller" in flags:
        raise S2C2AError(
            "--controller is now --strategy, as in: s2c2a run circle --strategy s2c2a pcc"
        )
    if verb == "live" and "--strategy" in flags:
        raise S2C2AError(
            "--strategy is now --weights, as in: s2c2a live --weights mine.safetensors"
        )
    files = [word.split("=")[-1] for word in words if word.endswith(".safetensors")]
    if verb == "run" and "--strategy" in flags and "--weights" not in flags and files:
        raise S2C2AError(
            f"files are given with --weights, strategies by name: --weights {files[0]}"
        )
    for flag, word in zip(("", *flags), ("", *words), strict=True):
        if instead := GONE.get(verb, {}).get(
            flag.replace("_", "-").replace("--no-", "--")
        ):
            raise S2C2AError(f"`{f's2c2a {verb} {word}'.strip()}` is gone; {instead}")
