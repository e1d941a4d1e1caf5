"""Words of the command line that were others in version 0.1: one clear error each, for one release."""

from collections.abc import Sequence

from s2c2a.errors import S2C2AError


def check_renamed(arguments: Sequence[str]) -> None:
    """Raise S2C2AError where an option is given by its old name."""
    verb = arguments[0] if arguments else ""
    flags = [argument.partition("=")[0] for argument in arguments]
    if verb == "run" and "--controller" in flags:
        raise S2C2AError("--controller is now --strategy, as in: s2c2a run circle --strategy s2c2a pcc")
    if verb == "live" and "--strategy" in flags:
        raise S2C2AError("--strategy is now --weights, as in: s2c2a live --weights mine.safetensors")
    files = [argument for argument in arguments if argument.endswith(".safetensors")]
    if verb == "run" and "--strategy" in flags and "--weights" not in flags and files:
        raise S2C2AError(f"files are given with --weights, strategies by name: --weights {files[0].split('=')[-1]}")
    _refuse_gone(arguments)


# fmt: off
_PARTS = (
    "startup", "plan", "batch", "step", "profile", "jitter", "collect", "training", "simulation", "rods", "growth",
)
_FLAGS = (
    "seed", "repeats", "long-repeats", "ticks", "memory-ticks", "device", "quick", "whole-torch", "overwrite",
)
# fmt: on
_BENCHMARKS = "benchmarks stand beside the package: in a clone of s2c2a, say"
GONE = {
    "bench": {part: f"{_BENCHMARKS} `pytest benchmarks/bench_{part}.py`" for part in _PARTS}
    | {f"--{flag}": f"{_BENCHMARKS} `make bench` (benchmarks/README.md has its options)" for flag in _FLAGS},
    "reproduce": {"rod": f"{_BENCHMARKS} `python benchmarks/simulator_accuracy.py`"},
    "bench-live": {"": f"{_BENCHMARKS} `pytest benchmarks/bench_live.py`"},
}
"""Verb -> word, nothing for the verb itself -> what to do."""


def _refuse_gone(arguments: Sequence[str]) -> None:
    """Tell of a word that is gone what has come in its place."""
    verb, *words = arguments or [""]
    for word in ("", *words):
        bare = word.split("=")[0].replace("_", "-").replace("--no-", "--")
        if instead := GONE.get(verb, {}).get(bare):
            raise S2C2AError(f"`s2c2a {verb} {word}`".replace(" `", "`") + f" is gone; {instead}")
