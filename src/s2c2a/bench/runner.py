"""Running parts one after the other, each in a process of its own."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence

from s2c2a.arm import load_arm
from s2c2a.bench.lines import Failed, Line, held_to_limits, line_from_json, options_to_json
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.parts import PARTS, Part
from s2c2a.bench.timing import Progress
from s2c2a.errors import S2C2AError

WORKER = "s2c2a.bench.worker"
ALONE = {"JAX_ENABLE_COMPILATION_CACHE": "false", "PYTHONIOENCODING": "utf-8"}
"""What a part's process is told: to compile everything itself, so that no figure depends on what ran before."""

PLATFORMS = {"cpu": "cpu", "gpu": "cuda"}
LAST_WORDS = 2000  # characters of what a process complained of


def chosen(names: Sequence[str]) -> list[Part]:
    """The parts of these names, in the order in which they run; all if none is named.

    Raises:
        S2C2AError: there is no such part.
    """
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        raise S2C2AError(f"no part {', '.join(unknown)}; choose from {', '.join(PARTS)}")
    return [part for part in PARTS.values() if part.name in names or not names]


def lines_of(part: Part, options: BenchOptions, progress: Progress) -> Iterator[Line]:
    """Measure one part in a process of its own; lines come as they are measured, a failure as the last but one.

    Leaving early, as an interrupt does, ends the process.
    """
    twin = load_arm("twin_arm")
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as complaints:
        process = subprocess.Popen(
            [sys.executable, "-m", WORKER, str(part.cores)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            encoding="utf-8",
            env={**os.environ, **ALONE, "JAX_PLATFORMS": PLATFORMS[options.device]},
        )
        try:
            for line in _heard(process, part, options, progress):
                yield held_to_limits(line, options.arm, twin)
            if process.wait():
                complaints.seek(0)
                yield Failed(part.name, f"ended with {process.returncode}: {complaints.read()[-LAST_WORDS:]}")
        finally:
            process.terminate()
            process.wait()


def _heard(process: subprocess.Popen, part: Part, options: BenchOptions, progress: Progress) -> Iterator[Line]:
    """Give the order, then hear what is said until the process ends."""
    if process.stdin is None or process.stdout is None:
        raise S2C2AError(f"the process of '{part.name}' cannot be talked to; try again")
    with process.stdin as order:
        json.dump({"part": part.name, "options": options_to_json(options)}, order)
    with process.stdout as said:
        for text in said:
            message = json.loads(text)
            if "progress" in message:
                progress(*message["progress"])
            else:
                yield line_from_json(message["line"])
