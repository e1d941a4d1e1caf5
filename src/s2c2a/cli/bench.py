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

from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.cli.console import Arm, print_table
from s2c2a.cli.first_action import driver_of

QUIET_LOAD = 0.5
REPEATS, SECONDS_SIMULATED, STARTS = 1000, 50, 5
WARM_UP = 10  # one call in so many is made before and not counted
ASKED = {
    "a plan": 1.3e-3,
    "a tick": 2e-3,
    "a later start": 3.0,
    "a simulated second, fast": 4e-3,
    "a simulated second, accurate": 40e-3,
}
"""What the project holds itself to on `twin_arm` and two cores of a common server: medians [s] (docs/benchmarks.md)."""


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
        arm: a preset, driven by the networks that come with the package, or an arm file, driven by PCC.
        out: a file for the figures, as JSON; replaced if it exists.
    """
    spec, load = load_arm(arm), os.getloadavg()[0]
    if load > QUIET_LOAD:
        print(f"this machine is busy (load {load:.1f}): times will be too long")
    asked = ASKED if spec.same_body(load_arm("twin_arm")) else {}
    figures = [*control_times(spec), *simulation_times(spec), Figure("a later start", start_times(arm))]
    rows = [_cells(figure, asked.get(figure.what)) for figure in figures]
    print_table(f"{spec.name} on this machine", ("what", "median", "99th percentile", "at most"), rows)
    machine = _machine()
    print("; ".join(f"{name} {value}" for name, value in machine.items()))
    if out:
        print(f"kept in {_save(out, spec, figures, asked, machine | {'load': load})}")


def control_times(arm: ArmSpec) -> Iterator[Figure]:
    """Plans around the circle, each from the last, and whole ticks (sense, plan, act) on the readings of a run."""
    import jax

    from s2c2a import planning, strategies, tasks
    from s2c2a.robots.simulation import SimulatedRobot

    model, strategy = driver_of(arm)
    goals = tasks.circle(arm).goals
    planner = planning.Planner(arm, model, strategies.recipe_named("best").planner)
    plan, wanted = planner.start(np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))), cycle(goals)

    def next_plan() -> None:
        nonlocal plan
        plan = jax.block_until_ready(planner.plan(plan, plan.configurations, next(wanted)))

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
            seconds = times_of(partial(_call_with_each, robot.step, actions), SECONDS_SIMULATED)
        yield Figure(f"a simulated second, {fidelity}", seconds / (steps * arm.control_period))


def _call_with_each(call: Callable[[Any], object], given: Iterable[Any]) -> None:
    for one in given:
        call(one)


def start_times(arm: str, starts: int = STARTS) -> list[float]:
    """From the start of a process to its first action [s], with what an earlier start has compiled.

    Raises:
        S2C2AError: a process ended before it acted.
    """
    return [_start(arm) for _ in range(1 + starts)][1:]


def times_of(call: Callable[[], object], repeats: int):
    """How long a call takes, again and again [s], shape (repeats,)."""
    for _ in range(-(-repeats // WARM_UP)):
        call()
    ends = [time.perf_counter()]
    for _ in range(repeats):
        call()
        ends.append(time.perf_counter())
    return np.diff(ends)


def _start(arm: str) -> float:
    from s2c2a.errors import S2C2AError

    began = time.perf_counter()
    command = [sys.executable, "-m", "s2c2a.cli.first_action", arm]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        said = process.stdout.readline() if process.stdout else ""
        took = time.perf_counter() - began
        complaint = process.communicate()[1]
    if not said:
        raise S2C2AError(f"the start of '{arm}' in a process of its own failed: {complaint[-500:]}")
    return took


def _cells(figure: Figure, asked: float | None) -> tuple[str, ...]:
    return figure.what, *(_time(figure.percentile(share)) for share in (50, 99)), _time(asked) if asked else ""


def _time(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 1 else f"{1e3 * seconds:.2f} ms"


def _machine() -> dict[str, object]:
    """What figures depend on: the machine, and versions."""
    from s2c2a.executors import all_cores
    from s2c2a.versions import versions

    info = Path("/proc/cpuinfo")
    said = info.read_text(encoding="utf-8") if info.is_file() else ""
    model = re.search(r"^model name\s*: (.*)$", said, re.MULTILINE)
    processor = model[1].strip() if model else platform.processor()
    return {"processor": processor, "cores": all_cores(), "system": platform.platform(), **versions()}


def _save(path: Path, arm: ArmSpec, figures: Sequence[Figure], asked: dict[str, float], machine: dict) -> Path:
    from s2c2a.files import save_whole

    told = [
        {"what": each.what, "median": each.percentile(50), "percentile_99": each.percentile(99)}
        | {"repeats": len(each.seconds), "at_most": asked.get(each.what)}
        for each in figures
    ]
    content = {"arm": arm.model_dump(mode="json"), "machine": machine, "seconds": told}
    return save_whole(json.dumps(content, indent=1), path)
