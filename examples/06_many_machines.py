"""What a cluster costs and where it ends, measured on this machine (docs/cluster.md): pass the number of workers."""

import pickle
import sys
import tempfile
import time
from concurrent.futures import wait
from functools import partial
from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions, collect
from s2c2a.experiments.cluster import Cluster
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.shards import Here, all_cores

WORKERS = int(sys.argv[1]) if len(sys.argv) > 1 else all_cores()
EPISODE = 50.0  # s of the arm's time in 500 samples at 10 Hz
HOURS = 1_000_000


def gather(folder: str, crew, episodes: int) -> tuple[Path, float]:
    """Collect; returns the file and how long it took [s]."""
    path = Path(folder) / f"{type(crew).__name__}-{episodes}.h5"
    arm, began = load_arm("twin_arm"), time.perf_counter()
    robot = partial(SimulatedRobot, arm, "fast")
    collect(path, arm, robot, CollectOptions(episodes=episodes), crew=crew, overwrite=True)
    return path, time.perf_counter() - began


def main() -> None:
    """Four figures, the growth from one worker to many, and what follows for a million arm-hours."""
    with tempfile.TemporaryDirectory() as folder:
        gather(folder, Here(), 1)
        used = time.process_time()
        recording, _ = gather(folder, Here(), 4)
        speed = 4 * EPISODE / (time.process_time() - used)
        sample = recording.stat().st_size / (4 * 500)
        print(f"fast, one thread: {speed:.0f} arm seconds per second of its core")
        print(f"recording: {sample:.0f} bytes a sample, {500 * sample / 1e3:.0f} kB a shard")
        shard = len(pickle.dumps(partial(SimulatedRobot, load_arm("twin_arm"), "fast")))
        print(f"sent for a shard: {shard / 1e3:.1f} kB")
        took = {}
        for workers in sorted({1, WORKERS}):
            with Cluster("local", workers) as crew:
                gather(folder, crew, 2 * workers)  # starts and imports
                _, took[workers] = gather(folder, crew, 8 * workers)
                began = time.perf_counter()
                empty = [crew.submit(abs, number) for number in range(1000)]
                wait(empty)
                overhead = (time.perf_counter() - began) / len(empty)
            rate = 8 * workers * EPISODE / took[workers]
            print(f"{workers} workers: {rate:.0f} arm seconds per second; {1e3 * overhead:.2f} ms for an empty shard")
    cores, disk = HOURS * 3600 / speed / 86400, HOURS * 3600 * 10 * sample
    print(f"a million arm-hours: {cores:.0f} core-days, {disk / 1e12:.1f} TB")
    print(
        f"one client and scheduler keep up to {EPISODE / speed / overhead:.0f} cores busy with shards of {EPISODE:g} s"
    )


if __name__ == "__main__":  # workers are processes that import this file
    main()
