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
from s2c2a.executors import Serial, all_cores, in_order
from s2c2a.jobs.cluster import Cluster
from s2c2a.robots.simulation import SimulatedRobot

WORKERS = int(sys.argv[1]) if len(sys.argv) > 1 else all_cores()
EPISODE = 50.0  # s of the arm's time in 500 samples at 10 Hz
HOURS = 1_000_000


def gather(folder: str, executor, episodes: int) -> tuple[Path, float, float]:
    """Collect; returns the file, how long it took [s], and this process's share of the work [s of a core]."""
    path = Path(folder) / "twin.episodes"
    robot = partial(SimulatedRobot, load_arm("twin_arm"), "fast")
    began = time.perf_counter()
    used = time.process_time()
    collect(
        path,
        load_arm("twin_arm"),
        robot,
        CollectOptions(episodes=episodes),
        executor=executor,
        overwrite=True,
    )
    return path, time.perf_counter() - began, time.process_time() - used


def handled(executor, size: int, calls: int = 200) -> float:
    """What client and scheduler, both in this process, take for a call that hands back so many bytes [s of a core]."""
    used = time.process_time()
    wait([executor.submit(bytes, size) for _ in range(calls)])
    return (time.process_time() - used) / calls


def stand_in(seconds: float, size: int) -> bytes:
    """A call as long and as large as an episode that takes no core: for more workers than there are cores."""
    time.sleep(seconds)
    return bytes(size)


def main() -> None:
    """What a call costs, how the rate grows with workers, and what follows for a million arm-hours."""
    with tempfile.TemporaryDirectory() as folder:
        gather(folder, Serial(), 1)
        recording, _, used = gather(folder, Serial(), 8)
        speed = 8 * EPISODE / used
        sample = recording.stat().st_size / (8 * 500)
        print(
            f"fast, one thread: {speed:.0f} arm seconds per second of its core; {sample:.0f} bytes a sample"
        )
        with Cluster("local", WORKERS) as executor:
            gather(folder, executor, 2 * WORKERS)  # starts and imports
            _, took, _ = gather(folder, executor, 8 * WORKERS)
            empty = handled(executor, 0)
            full = handled(executor, int(500 * sample))
    print(
        f"{WORKERS} workers: {8 * WORKERS * EPISODE / took:.0f} arm seconds per second"
    )
    print(
        f"client and scheduler: {1e3 * full:.1f} ms a call of {sample / 2:.0f} kB, {1e3 * empty:.1f} an empty one"
    )
    for workers in (1, 8 * WORKERS, 32 * WORKERS, 128 * WORKERS):
        there = LocalCluster(
            n_workers=1, threads_per_worker=workers, dashboard_address="127.0.0.1:0"
        )
        with there, Cluster(there.scheduler_address) as executor:
            began = time.perf_counter()
            sizes = [int(500 * sample)] * (4 * workers)
            done = sum(
                1 for _ in in_order(executor, partial(stand_in, EPISODE / speed), sizes)
            )
            rate = done / (time.perf_counter() - began)
        print(
            f"{workers:4d} stand-ins: {rate:5.1f} calls a second, {workers * speed / EPISODE:6.1f} without client"
        )
    days = HOURS * 3600 / speed / 86400
    disk = HOURS * 3600 * 10 * sample
    print(
        f"a million arm-hours: {days:.0f} core-days, {disk / 1e12:.1f} TB, {HOURS * 0.02 / rate:.0f} h of one client"
    )


if __name__ == "__main__":  # workers are processes that import this file
    main()
