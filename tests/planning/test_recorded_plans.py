"""Plans are those that were recorded: a change of the planner that shows is meant.

`python tests/planning/test_recorded_plans.py` records them again, of the same problems.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import jax
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.estimation import Estimate, EstimationSettings
from s2c2a.execution.compilation import forget_programs
from s2c2a.goals import MAX_OBSTACLES, Goal
from s2c2a.planning.guides import Lead
from s2c2a.strategies import networks_from, strategy_of
from s2c2a.strategies.options import RunOptions

from marks import slow_after

FILE = Path(__file__).with_name("recorded_plans.npz")
LOAD = EstimationSettings(known_payload=0.02)
"""Rounding grows with it: programs of little optimization differ by 0.3 of `NEAR`, with
50 g by 2.4 times as much as `NEAR`."""
PROBLEMS = {
    "reach": ("twin_arm", RunOptions(guard="arm")),  # past two obstacles, with a guide
    "circle": ("twin_arm", RunOptions()),
    "payload": ("twin_arm", RunOptions(estimation=LOAD)),
    "hold": ("simulated_arm", RunOptions()),
}
NEAR = 1e-4
"""Of configurations and states [1, m]: rounding grows from step to step, and more on the
circle, of which there are fewer steps."""
PROGRAMS = {"hold": 12}
"""At the start of a run, with what an estimate of a payload needs; else `FEW`."""
FEW = 8
OUTPUTS = ("judged", "configurations", "states", "horizon")
COMPILED: list[str] = []
"""An event for every program that was compiled, or read from the cache."""


def count_compilation(event: str, duration_secs: float, **_: str | int) -> None:
    if event == "/jax/core/compile/backend_compile_duration":
        COMPILED.append(event)


jax.monitoring.register_event_duration_secs_listener(count_compilation)


@cache
def recorded(name: str) -> dict[str, np.ndarray]:
    with np.load(FILE) as file:
        keys = [key for key in file.files if key.startswith(f"{name}.")]
        return {key.removeprefix(f"{name}."): file[key] for key in keys}


def at(values: np.ndarray, step: int) -> np.ndarray:
    """What stays the same is recorded once."""
    return values[min(step, len(values) - 1)]


def goal_at(problem: dict[str, np.ndarray], step: int, modules: int) -> Goal:
    keys = [key for key in problem if key.startswith("goal_")]
    known = {key.removeprefix("goal_"): at(problem[key], step) for key in keys}
    for name in ("obstacles", "thresholds", "cores"):
        rows = MAX_OBSTACLES - len(known[name])
        padding = ((0, rows), *((0, 0),) * (known[name].ndim - 1))
        known[name] = np.pad(known[name], padding)
    return Goal.of(modules)._replace(**known)


def lead_at(problem: dict[str, np.ndarray], step: int, modules: int) -> Lead:
    if "lead_bends" not in problem:
        return Lead.none(modules)
    return Lead(*(at(problem[f"lead_{name}"], step) for name in Lead._fields))


def plans(name: str) -> Iterator[dict[str, np.ndarray]]:
    """Outputs of every step of a problem."""
    arm_name, options = PROBLEMS[name]
    arm = load_arm(arm_name)
    problem = recorded(name)
    forget_programs(max_maps=0)
    before = len(COMPILED)
    networks = networks_from("shipped", arm)
    strategy = strategy_of(networks, options)
    assert len(COMPILED) - before <= PROGRAMS.get(name, FEW)
    planner, model = strategy.planner, networks.c2s
    payload = options.estimation.known_payload
    observe = jax.jit(lambda sensed, memory: model.observe(sensed, memory))
    memory = jax.jit(lambda sensed: model.start(sensed))(problem["start"])

    def estimate(sensed):
        if payload:
            return Estimate.of(sensed, payload, hysteresis=memory)
        return Estimate(sensed, hysteresis=memory)

    plan = planner.start(estimate(problem["start"]))
    for step, sensed in enumerate(problem["sensed"]):
        lead = lead_at(problem, step, arm.module_count)
        planner._lead = lambda *_, lead=lead: lead
        memory = observe(sensed, memory)
        goal = goal_at(problem, step, arm.module_count)
        plan = planner.plan(plan, estimate(sensed), goal)
        ahead = plan.expectation
        found = plan.judged, plan.configurations, ahead.states, ahead.horizon
        yield dict(zip(OUTPUTS, map(np.asarray, found), strict=True))


@pytest.mark.parametrize("name", slow_after(1, sorted(PROBLEMS, reverse=True)))
def test_plans_are_those_that_were_recorded(name):
    problem = recorded(name)
    for step, found in enumerate(plans(name)):
        for output in OUTPUTS:
            expected = problem[output][step]
            np.testing.assert_allclose(found[output], expected, atol=NEAR)


def record() -> None:
    """Write the outputs of the present planner in the place of the recorded ones."""
    with np.load(FILE) as file:
        arrays = dict(file)
    for name in PROBLEMS:
        steps = list(plans(name))
        for output in OUTPUTS:
            arrays[f"{name}.{output}"] = np.stack([step[output] for step in steps])
    np.savez_compressed(FILE, **arrays)


if __name__ == "__main__":
    record()
