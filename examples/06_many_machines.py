"""What a cluster costs and where it ends, measured on this machine (docs/cluster.md): pass the number of workers."""

import sys
import tempfile
import time
from concurrent.futures import wait
from functools import partial
from pathlib import Path

from distributed import LocalCluster

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions, collect
from s2c2a.experiments.cluster import Cluster
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.shards import Here, all_cores, in_order

WORKERS = int(sys.argv[1]) if len(sys.argv) > 1 else all_cores()
EPISODE = 50.0  # s of the arm's time in 500 samples at 10 Hz
HOURS = 1_000_000


def gather(folder: str, crew, episodes: int) -> tuple[Path, float, float]:
    """Collect; returns the file, how long it took [s], and this process's share of the work [s of a core]."""
    path = Path(folder) / "twin.h5"
    robot = partial(SimulatedRobot, load_arm("twin_arm"), "fast")
    began, used = time.perf_counter(), time.process_time()
    collect(path, load_arm("twin_arm"), robot, CollectOptions(episodes=episodes), crew=crew, overwrite=True)
    return path, time.perf_counter() - began, time.process_time() - used


def handled(crew, size: int, shards: int = 200) -> float:
    """What client and scheduler, both in this process, take for a shard that hands back so many bytes [s of a core]."""
    used = time.process_time()
    wait([crew.submit(bytes, size) for _ in range(shards)])
    return (time.process_time() - used) / shards


def stand_in(seconds: float, size: int) -> bytes:
    """A shard as long and as large as an episode that takes no core: for more workers than there are cores."""
    time.sleep(seconds)
    return bytes(size)


def main() -> None:
    """What a shard costs, how the rate grows with workers, and what follows for a million arm-hours."""
    with tempfile.TemporaryDirectory() as folder:
        gather(folder, Here(), 1)
        recording, _, used = gather(folder, Here(), 8)
        speed, sample = 8 * EPISODE / used, recording.stat().st_size / (8 * 500)
        print(f"fast, one thread: {speed:.0f} arm seconds per second of its core; {sample:.0f} bytes a sample")
        with Cluster("local", WORKERS) as crew:
            gather(folder, crew, 2 * WORKERS)  # starts and imports
            _, took, _ = gather(folder, crew, 8 * WORKERS)
            empty, shard = handled(crew, 0), handled(crew, int(500 * sample))
    print(f"{WORKERS} workers: {8 * WORKERS * EPISODE / took:.0f} arm seconds per second")
    print(f"client and scheduler: {1e3 * shard:.1f} ms a shard of {sample / 2:.0f} kB, {1e3 * empty:.1f} an empty one")
    for workers in (1, 8 * WORKERS, 32 * WORKERS, 128 * WORKERS):
        there = LocalCluster(n_workers=1, threads_per_worker=workers, dashboard_address="127.0.0.1:0")
        with there, Cluster(there.scheduler_address) as crew:
            began, shards = time.perf_counter(), [int(500 * sample)] * (4 * workers)
            done = sum(1 for _ in in_order(crew, partial(stand_in, EPISODE / speed), shards))
            rate = done / (time.perf_counter() - began)
        print(f"{workers:4d} stand-ins: {rate:5.1f} shards a second, {workers * speed / EPISODE:6.1f} without client")
    days, disk = HOURS * 3600 / speed / 86400, HOURS * 3600 * 10 * sample
    print(f"a million arm-hours: {days:.0f} core-days, {disk / 1e12:.1f} TB, {HOURS * 0.02 / rate:.0f} h of one client")


if __name__ == "__main__":  # workers are processes that import this file
    main()
