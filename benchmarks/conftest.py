"""Shared by all benchmarks: arm, device, cores, trained networks, table header."""

import os
import time
from functools import cache, partial

import numpy as np
import pytest

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(threads, "1")  # before anything heavy is imported


def pytest_addoption(parser):
    parser.addoption("--arm", default="twin_arm", help="a preset or an arm file")
    parser.addoption(
        "--device",
        default="cpu",
        choices=("cpu", "gpu"),
        help="that JAX computes on: batch, training",
    )
    parser.addoption(
        "--minutes", default=10.0, type=float, help="of random drags on the live page"
    )


def pytest_configure(config):
    """Select the device; keep no compiled program, so that runs are independent."""
    import jax

    jax.config.update("jax_enable_compilation_cache", False)
    device = config.getoption("--device")
    jax.config.update("jax_platforms", {"cpu": "cpu", "gpu": "cuda"}[device])
    if device == "gpu":
        try:
            jax.devices()
        except Exception as error:  # JAX has several for it
            raise pytest.UsageError(
                "JAX finds no GPU here; choose --device cpu, or install "
                '`pip install ".[gpu]"` on a machine with a GPU'
            ) from error


def pytest_collection_finish(session):
    """Set the core affinity of this process before JAX starts threads, if possible."""
    counts = [
        mark.args[0] for item in session.items for mark in item.iter_markers("cores")
    ]
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(
            0, sorted(os.sched_getaffinity(0))[-max(counts, default=1) :]
        )


def pytest_benchmark_update_machine_info(config, machine_info):
    from s2c2a.execution.executors import all_cores
    from s2c2a.execution.versions import versions

    options = {name: config.getoption(f"--{name}") for name in ("arm", "device")}
    machine_info |= options | {
        "load": os.getloadavg()[0],
        "cores": all_cores(),
        "versions": versions(),
    }


def pytest_terminal_summary(terminalreporter, config):
    """What stands beside the times, and exponents of power laws where a size grows."""
    grown = {}
    for one in config._benchmarksession.benchmarks:
        if one.extra_info:
            words = ", ".join(
                f"{name} {_shown(value)}" for name, value in one.extra_info.items()
            )
            terminalreporter.write_line(f"{one.name}: {words}")
        size = (one.params or {}).get("size", 0)
        if size > 0:  # zero has no logarithm
            others = [
                str(value) for name, value in one.params.items() if name != "size"
            ]
            grown.setdefault(" ".join([one.name.split("[")[0], *others]), []).append(
                (size, one.stats.median)
            )
    for name, points in grown.items():
        if len(points) > 1:
            sizes, medians = np.log(np.array(sorted(points))).T
            slope = np.polyfit(sizes, medians, 1)[0]
            steepest = max(np.diff(medians) / np.diff(sizes))
            terminalreporter.write_line(
                f"{name} grows with exponent {slope:.2f}, {steepest:.2f} where steepest"
            )


def _shown(value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@pytest.fixture(scope="session")
def arm(request):
    from s2c2a.arm import load_arm

    return load_arm(request.config.getoption("--arm"))


@pytest.fixture(scope="session")
def networks_of(arm):
    """Trained networks of a recipe, seed 0, cached or trained first (untimed)."""
    from s2c2a.jobs import Cache, NetworksArtifact, made
    from s2c2a.strategies import recipe_named

    return cache(
        lambda recipe: made(NetworksArtifact(arm, recipe_named(recipe), 0), Cache())
    )


@pytest.fixture(params=["best", "paper"])
def networks(request, networks_of):
    """Those of either recipe."""
    return networks_of(request.param)


@pytest.fixture(autouse=True)
def _beside(request, arm, benchmark):
    """The 99th percentile, and on the twin what is asked of a figure."""
    yield
    if benchmark.stats and len(times := benchmark.stats.stats.data) > 1:
        benchmark.extra_info["99 % [ms]"] = 1e3 * float(np.percentile(times, 99))
    mark = request.node.get_closest_marker("asked")
    if mark and arm.name == "twin_arm":
        benchmark.extra_info["asked:"] = mark.args[0]


@pytest.fixture
def in_turn(benchmark):
    """(call, theirs, rival, rounds): time a call and a rival alternately."""

    def timed(call, theirs, rival: str, rounds: int) -> None:
        times = []
        benchmark.pedantic(
            call,
            setup=partial(_timed, theirs, times),
            rounds=rounds,
            warmup_rounds=-(-rounds // 10),
        )
        if benchmark.stats:
            theirs_median = float(np.median(times[-rounds:]))
            benchmark.extra_info[f"{rival} [ms]"] = 1e3 * theirs_median
            benchmark.extra_info[f"{rival} over it"] = (
                theirs_median / benchmark.stats.stats.median
            )

    return timed


def _timed(call, times: list) -> None:
    began = time.perf_counter()
    call()
    times.append(time.perf_counter() - began)
