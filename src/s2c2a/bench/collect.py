"""Collecting a recording of 9000 samples."""

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from s2c2a.bench.measurement import Limit, Measurement, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Progress
from s2c2a.data import CollectOptions, collect
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.shards import all_cores
from s2c2a.strategies import recipe_named

COLLECT_LIMIT = Limit(8.0)  # of 9000 samples
FEW_EPISODES = 2


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement]:
    """Whole recordings as a user collects them, file and all."""
    how = CollectOptions(seed=options.seed, speeds=recipe_named("best").speeds)
    if options.quick:
        yield collecting(options, replace(how, episodes=FEW_EPISODES), progress)
    else:
        yield collecting(options, how, progress, COLLECT_LIMIT)


def collecting(
    options: BenchOptions, how: CollectOptions, progress: Progress, limit: Limit | None = None
) -> Measurement:
    """The time of a recording, on every core that there is."""
    arm, seconds = options.arm, []
    with TemporaryDirectory() as folder:
        for number in range(options.long_repeats):
            told = partial(progress, f"collecting, {number + 1} of {options.long_repeats}")
            began = time.perf_counter()
            collect(
                Path(folder) / "recording.h5",
                arm,
                lambda seed: SimulatedRobot(arm, "fast", seed),
                how,
                threads=all_cores(),
                overwrite=True,
                progress=told,
            )
            seconds.append(time.perf_counter() - began)
    samples, cores = how.episodes * how.samples, all_cores()
    return timing(f"{samples} samples, fast, {cores} core(s)", np.array(seconds), limit)
