"""Start-up: from the start of a process to its end, and the most memory that it holds."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from s2c2a.bench.machine import mebibytes
from s2c2a.bench.measurement import Limit, Measurement, memory, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Progress
from s2c2a.errors import S2C2AError
from s2c2a.experiments.workshop import Workshop
from s2c2a.strategies import recipe_named, save_strategy

LIMITS = {"s2c2a --help": Limit(0.6), "import s2c2a": Limit(0.3)}
SECOND_START = Limit(3.0)
FIRST_TICK = "from s2c2a.cache import keep_programs; keep_programs(); from s2c2a.bench.first_tick import main; main()"
LAUNCHER = str(Path(__file__).with_name("launcher.py"))
COMMANDS = {
    "s2c2a --help": (sys.executable, "-c", "from s2c2a.cli.main import main; main()", "--help"),
    "import s2c2a": (sys.executable, "-c", "import s2c2a"),
}


class Launch:
    """A command that is run to its end, again and again.

    Attributes:
        seconds: that it ran, each time [s].
        peaks: most memory that it held, each time [MiB].
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] | None = None):
        self._command = (sys.executable, "-I", "-S", LAUNCHER, *command)
        bare = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}  # as a user's
        self._environment = {**bare, **(environment or {})}
        self.seconds: list[float] = []
        self.peaks: list[float] = []

    def __call__(self) -> None:
        """Run it.

        Raises:
            S2C2AError: it failed.
        """
        done = subprocess.run(self._command, env=self._environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise S2C2AError(f"{' '.join(self._command[4:])} ended with {done.returncode}: {done.stderr[-500:]}")
        seconds, peak = done.stdout.split()
        self.seconds.append(float(seconds))
        self.peaks.append(mebibytes(int(peak)))


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement]:
    """The command's help, the import, and trained strategies' first and later starts, in turn."""
    with TemporaryDirectory() as folder:
        launches = {name: Launch(command) for name, command in COMMANDS.items()}
        for recipe in ("best", "paper"):
            networks = Workshop(progress=progress).networks(options.arm, recipe_named(recipe), options.seed)
            path = Path(folder) / f"{recipe}.safetensors"
            save_strategy(networks, path)
            first, later = (first_ticks(path, Path(folder) / f"programs-{recipe}") for _ in range(2))
            first()
            yield timing(f"first tick, {recipe}, first start", np.array(first.seconds), note="compiles everything")
            launches[f"first tick, {recipe}, later start"] = later
        yield from launched(launches, options.long_repeats, partial(progress, "starting"))


def launched(
    launches: Mapping[str, Launch], repeats: int, progress: Callable[[int, int], None]
) -> Iterator[Measurement]:
    """Time and peak memory of commands that are run in turn."""
    for number in range(repeats):
        progress(number, repeats)
        for launch in launches.values():
            launch()
    progress(repeats, repeats)
    for name, launch in launches.items():
        yield timing(name, np.array(launch.seconds), LIMITS.get(name, SECOND_START))
        yield memory(f"{name}: peak memory", launch.peaks)


def first_ticks(path: Path, programs: Path) -> Launch:
    """A process from its start to a trained strategy's first tick; what it compiles is kept for the next one."""
    return Launch((sys.executable, "-c", FIRST_TICK, str(path)), {"S2C2A_CACHE": str(programs)})
