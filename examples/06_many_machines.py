"""Measure the overhead of a cluster on this machine: `06_many_machines.py WORKERS`."""

import sys
import tempfile
import time
from concurrent.futures import wait
from functools import partial
from pathlib import Path

from distributed import LocalCluster

import s2c2a
from s2c2a.execution.executors import Serial, all_cores, in_order
from s2c2a.jobs.cluster import Cluster

WORKERS = int(sys.argv[1]) if len(sys.argv) > 1 else all_cores()
EPISODE = 50.0  # s of simulated time: 500 samples at 10 Hz
ARM = s2c2a.load_arm("twin_arm")
COLLECT = partial(s2c2a.collect, ARM, recipe="paper", overwrite=True)


def measure_collection(folder: str, executor, episodes: int):
    """Collect episodes; return the file, wall time and process CPU time [s]."""
    path = Path(folder) / "twin.episodes"
    start = time.perf_counter()
    cpu_start = time.process_time()
    COLLECT(path, episodes=episodes, executor=executor)
    return path, time.perf_counter() - start, time.process_time() - cpu_start


def call_overhead(executor, size: int, calls: int = 200) -> float:
    """CPU time [s] of client and scheduler for one call that returns `size` bytes."""
    start = time.process_time()
    wait([executor.submit(bytes, size) for _ in range(calls)])
    return (time.process_time() - start) / calls


def dummy_episode(seconds: float, size: int) -> bytes:
    """Wait as long as an episode takes and return as many bytes, without CPU time."""
    time.sleep(seconds)
    return bytes(size)


def main() -> None:
    """Print the cost of a call and the rates."""
    with tempfile.TemporaryDirectory() as folder:
        measure_collection(folder, Serial(), 1)
        recording, _, cpu_time = measure_collection(folder, Serial(), 8)
        speed = 8 * EPISODE / cpu_time
        sample = recording.stat().st_size / (8 * 500)
        print(f"fast, one thread: {speed:.0f} arm seconds per core second")
        with Cluster("local", WORKERS) as executor:
            measure_collection(folder, executor, 2 * WORKERS)  # warm-up
            _, wall_time, _ = measure_collection(folder, executor, 8 * WORKERS)
            empty = call_overhead(executor, 0)
            full = call_overhead(executor, int(500 * sample))
    rate = 8 * WORKERS * EPISODE / wall_time
    print(f"{WORKERS} workers: {rate:.0f} arm seconds per second")
    print(f"client: {1e3 * full:.1f} ms a call of {sample / 2:.0f} kB")
    print(f"client: {1e3 * empty:.1f} ms an empty call")
    for workers in (1, 8 * WORKERS, 32 * WORKERS, 128 * WORKERS):
        options = {"threads_per_worker": workers, "dashboard_address": "127.0.0.1:0"}
        cluster = LocalCluster(n_workers=1, **options)
        with cluster, Cluster(cluster.scheduler_address) as executor:
            start = time.perf_counter()
            sizes = [int(500 * sample)] * (4 * workers)
            episode = partial(dummy_episode, EPISODE / speed)
            done = len(list(in_order(executor, episode, sizes)))
            rate = done / (time.perf_counter() - start)
        ideal = workers * speed / EPISODE
        print(f"{workers:4d} dummy workers: {rate:5.1f} of {ideal:6.1f} calls a second")


if __name__ == "__main__":  # workers are processes that import this file
    main()
