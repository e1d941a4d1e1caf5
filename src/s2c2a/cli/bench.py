"""`s2c2a bench`: how fast it is here."""

import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from s2c2a.estimation import Estimate
from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.cli.console import Arm, print_table
from s2c2a.cli.first_action import driver_of
from s2c2a.errors import S2C2AError
from s2c2a.executors import all_cores
from s2c2a.files import save_whole
from s2c2a.versions import versions

QUIET_LOAD = 0.5
REPEATS = 1000
SECONDS_SIMULATED = 50
STARTS = 5
WARM_UP = 10  # one call in so many is made before and not counted
ASKED = {
    "a plan": 1.3e-3,
    "a tick": 2e-3,
    "a later start": 3.0,
    "a simulated second, fast": 4e-3,
    "a simulated second, accurate": 40e-3,
}
"""What the project holds itself to on `twin_arm` and two cores of a common server:
medians [s] (docs/benchmarks.md)."""


class Figure(NamedTuple):
    """What was timed, and how long each time took [s]."""

    what: str
    seconds: Sequence[float]

    def percentile(self, share: float) -> float:
        """So many of a hundred times are shorter [s]."""
        return float(np.percentile(self.seconds, share))


def bench(arm: Arm = "twin_arm", out: Path | None = None) -> None:
    """Time a plan, a tick, a second start and a second of simulation. Leave the machine alone meanwhile.

    Args:
        arm: a preset, driven by the networks that come with the package, or an arm
            file, driven by PCC.
        out: a file for the figures, as JSON; replaced if it exists.
    """
    spec = load_arm(arm)
    load = os.getloadavg()[0]
    if load > QUIET_LOAD:
        print(f"this machine is busy (load {load:.1f}): times will be too long")
    asked = ASKED if spec.same_mechanics(load_arm("twin_arm")) else {}
    figures = [
        *control_times(spec),
        *simulation_times(spec),
        Figure("a later start", start_times(arm)),
    ]
    told = [_told(figure, asked.get(figure.what)) for figure in figures]
    rows = [
        (
            each["what"],
            *(_time(each[name]) for name in ("median", "percentile_99", "at_most")),
        )
        for each in told
    ]
    print_table(
        f"{spec.name} on this machine",
        ("what", "median", "99th percentile", "at most"),
        rows,
    )
    machine = _machine()
    print("; ".join(f"{name} {value}" for name, value in machine.items()))
    if out:
        kept = {
            "arm": spec.model_dump(mode="json"),
            "machine": machine | {"load": load},
            "seconds": told,
        }
        print(f"kept in {save_whole(json.dumps(kept, indent=1), out)}")


def control_times(arm: ArmSpec) -> Iterator[Figure]:
    """Plans around the circle, each from the last, and whole ticks (sense, plan, act) on the readings of a run."""
    import jax

    from s2c2a import planning, strategies, tasks
    from s2c2a.robots.simulation import SimulatedRobot

    model, strategy = driver_of(arm)
    goals = tasks.circle(arm).goals
    planner = planning.Planner(arm, model, strategies.recipe_named("best").planner)
    plan = planner.start(Estimate(np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))))
    desired = cycle(goals)

    def next_plan() -> None:
        nonlocal plan
        plan = jax.block_until_ready(
            planner.plan(plan, Estimate(plan.configurations), next(desired))
        )

    yield Figure("a plan", times_of(next_plan, REPEATS))
    with SimulatedRobot(arm) as robot:
        readings = [robot.read()]
        strategy.start(readings[0])
        for goal in goals:
            robot.step(strategy.step(readings[-1], goal))
            readings.append(robot.read())
    strategy.start(readings[0])
    steps = cycle(zip(readings, goals, strict=False))
    yield Figure("a tick", times_of(lambda: strategy.step(*next(steps)), REPEATS))


def simulation_times(arm: ArmSpec) -> Iterator[Figure]:
    """A second of the arm's time while it babbles, in every fidelity."""
    from s2c2a.data import episode_actions
    from s2c2a.robots import simulation

    steps = max(1, round(arm.control_rate))
    actions = episode_actions(ArmGeometry.of(arm), "motor", 0, 1, steps, 0)
    for fidelity in simulation.FIDELITIES:
        with simulation.SimulatedRobot(arm, fidelity) as robot:
            seconds = times_of(
                partial(_call_with_each, robot.step, actions), SECONDS_SIMULATED
            )
        yield Figure(
            f"a simulated second, {fidelity}", seconds / (steps * arm.control_period)
        )


def _call_with_each(call: Callable[[Any], object], given: Iterable[Any]) -> None:
    for one in given:
        call(one)


def start_times(arm: str, starts: int = STARTS) -> list[float]:
    """From the start of a process to its first action [s], with what an earlier start has compiled.

    Raises:
        S2C2AError: a process ended before it acted.
    """
    command = [sys.executable, "-m", "s2c2a.cli.first_action", arm]
    seconds = []
    for _ in range(1 + starts):
        began = time.time()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not done.stdout:
            raise S2C2AError(
                f"the start of '{arm}' in a process of its own failed: {done.stderr[-500:]}"
            )
        seconds.append(float(done.stdout) - began)
    return seconds[1:]


def times_of(call: Callable[[], object], repeats: int):
    """How long a call takes, again and again [s], shape (repeats,)."""
    for _ in range(-(-repeats // WARM_UP)):
        call()
    ends = [time.perf_counter()]
    for _ in range(repeats):
        call()
        ends.append(time.perf_counter())
    return np.diff(ends)


def _told(figure: Figure, asked: float | None) -> dict[str, Any]:
    said = {
        "what": figure.what,
        "median": figure.percentile(50),
        "percentile_99": figure.percentile(99),
    }
    return said | {"repeats": len(figure.seconds), "at_most": asked}


def _time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f"{seconds:.2f} s" if seconds >= 1 else f"{1e3 * seconds:.2f} ms"


def _machine() -> dict[str, object]:
    """What figures depend on: the machine, and versions."""
    info = Path("/proc/cpuinfo")
    said = info.read_text(encoding="utf-8") if info.is_file() else ""
    model = re.search(r"^model name\s*: (.*)$", said, re.MULTILINE)
    processor = model[1].strip() if model else platform.processor()
    return {
        "processor": processor,
        "cores": all_cores(),
        "system": platform.platform(),
        **versions(),
    }
