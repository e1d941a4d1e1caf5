"""Command `s2c2a bench`: computation times on this machine."""

import json
import os
import platform
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.cli.console import Arm, OptionalPath, print_table
from s2c2a.errors import S2C2AError
from s2c2a.execution.child import child_command
from s2c2a.execution.executors import all_cores
from s2c2a.execution.versions import versions
from s2c2a.files.text import write_atomically
from s2c2a_experiments.first_action import default_model_and_strategy

MAX_SYSTEM_LOAD = 0.5
REPEATS = 1000
SIMULATED_SECONDS = 50
STARTS = 5
WARM_UP_RATIO = 10  # one warm-up call for every ten timed calls
TIME_LIMITS = {
    "a plan": 1.3e-3,
    "a tick": 2e-3,
    "a later start": 3.0,
    "a simulated second, fast": 4e-3,
    "a simulated second, accurate": 40e-3,
}
"""Targets of the project for `twin_arm` on two cores of a common server: medians [s]
(docs/contribute/benchmarks.md)."""


class Timing(NamedTuple):
    """Measured times of one operation [s]."""

    operation: str
    seconds: Sequence[float]

    def percentile(self, percent: float) -> float:
        """Percentile of the times [s]."""
        return float(np.percentile(self.seconds, percent))


def bench(arm: Arm = "twin_arm", out: OptionalPath = None) -> None:
    """Time a plan, a control step, a second start and a simulated second.

    Do not use the machine meanwhile.

    Args:
        arm: a preset, which uses the networks of the package, or an arm file, which
            uses PCC.
        out: a JSON file for the times; replaced if it exists.
    """
    spec = load_arm(arm)
    load = os.getloadavg()[0]
    if load > MAX_SYSTEM_LOAD:
        print(f"this machine is busy (load {load:.1f}): times will be too long")
    timings = [
        *control_times(spec),
        *simulation_times(spec),
        Timing("a later start", start_times(arm)),
    ]
    limits = {} if spec.differences(load_arm("twin_arm")) else TIME_LIMITS
    entries = [_entry(timing, limits.get(timing.operation)) for timing in timings]
    _print_entries(spec, entries)
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8") if info.is_file() else ""
    model = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    machine = {
        "processor": model[1].strip() if model else platform.processor(),
        "cores": all_cores(),
        "system": platform.platform(),
        **versions(),
    }
    print("; ".join(f"{name} {value}" for name, value in machine.items()))
    if out:
        content = {
            "arm": spec.model_dump(mode="json"),
            "machine": machine | {"load": load},
            "seconds": entries,
        }
        print(f"saved: {write_atomically(json.dumps(content, indent=1), out)}")


def control_times(arm: ArmSpec) -> Iterator[Timing]:
    """Times of plans along the circle and of control steps (sense, plan, act).

    Each plan starts from the last one; control steps use the readings of a run.
    """
    import jax

    from s2c2a import planning, strategies, tasks
    from s2c2a.estimation import Estimate
    from s2c2a.robots.simulation import SimulatedRobot

    model, strategy = default_model_and_strategy(arm)
    goals = tasks.circle(arm).goals
    planner = planning.Planner(arm, model, strategies.recipe_named("best").planner)
    straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
    plan = planner.start(Estimate(straight))
    next_goals = cycle(goals)

    def update_plan() -> None:
        nonlocal plan
        plan = planner.plan(plan, Estimate(plan.configurations), next(next_goals))
        jax.block_until_ready(plan)

    yield Timing("a plan", times_of(update_plan, REPEATS))
    with SimulatedRobot(arm) as robot:
        readings = [robot.read()]
        strategy.start(readings[0])
        for goal in goals:
            robot.step(strategy.step(readings[-1], goal))
            readings.append(robot.read())
    strategy.start(readings[0])
    steps = cycle(zip(readings, goals, strict=False))
    yield Timing("a tick", times_of(lambda: strategy.step(*next(steps)), REPEATS))


def simulation_times(arm: ArmSpec) -> Iterator[Timing]:
    """Times of one simulated second of motor babbling, for each fidelity."""
    from s2c2a.data import episode_actions
    from s2c2a.robots import simulation

    steps = max(1, round(arm.control_rate))
    actions = episode_actions(ArmGeometry.of(arm), "motor", 0, 1, steps, 0)

    def simulate() -> None:
        for action in actions:
            robot.step(action)

    for fidelity in simulation.FIDELITIES:
        with simulation.SimulatedRobot(arm, fidelity) as robot:
            seconds = times_of(simulate, SIMULATED_SECONDS)
        yield Timing(
            f"a simulated second, {fidelity}", seconds / (steps * arm.control_period)
        )


def start_times(arm: str, starts: int = STARTS) -> list[float]:
    """Times from the start of a process to its first action [s], with a warm cache.

    Raises:
        S2C2AError: a process ended before its first action.
    """
    command = child_command("-m", "s2c2a_experiments.first_action", arm)
    seconds = []
    for _ in range(1 + starts):
        start = time.time()
        process = subprocess.run(
            command, capture_output=True, encoding="utf-8", check=False
        )
        if not process.stdout:
            raise S2C2AError(
                f"the start of '{arm}' in a process of its own failed: "
                f"{process.stderr[-500:]}"
            )
        seconds.append(float(process.stdout) - start)
    return seconds[1:]


def times_of(call: Callable[[], object], repeats: int):
    """Times of repeated calls [s], shape (repeats,), after a warm-up."""
    for _ in range(-(-repeats // WARM_UP_RATIO)):
        call()
    ends = [time.perf_counter()]
    for _ in range(repeats):
        call()
        ends.append(time.perf_counter())
    return np.diff(ends)


def _entry(timing: Timing, limit: float | None) -> dict[str, Any]:
    return {
        "what": timing.operation,
        "median": timing.percentile(50),
        "percentile_99": timing.percentile(99),
        "repeats": len(timing.seconds),
        "at_most": limit,
    }


def _print_entries(arm: ArmSpec, entries: list[dict[str, Any]]) -> None:
    header = ("operation", "median", "99th percentile", "at most")
    rows = []
    for entry in entries:
        times = [entry["median"], entry["percentile_99"], entry["at_most"]]
        rows.append((entry["what"], *map(_format_time, times)))
    print_table(f"{arm.name} on this machine", header, rows)


def _format_time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f"{seconds:.2f} s" if seconds >= 1 else f"{1e3 * seconds:.2f} ms"
