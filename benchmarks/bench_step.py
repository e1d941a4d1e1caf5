"""Parts of a control step: sensing, control, and whole steps; see also `bench_plan`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.control import Controller, CorrectedController, InversePCC, NetworkController
from s2c2a.execution.compilation import compiled
from s2c2a.kinematics import PCC
from s2c2a.strategies import s2c2a_strategy
from s2c2a.tasks import circle
from s2c2a.tasks.lines import reach

from driving import at_rest, straight, ticks_on


def test_sense(benchmark, networks):
    estimator = s2c2a_strategy(networks).estimator
    reading = at_rest(networks.arm)
    estimate = estimator.start(reading)
    command = np.zeros((networks.arm.module_count, networks.arm.cable_count))
    benchmark(
        lambda: jax.block_until_ready(estimator.update(estimate, reading, command))
    )


@pytest.mark.asked("at most 0.15 ms")
def test_learned_controller(benchmark, networks):
    controller = NetworkController(networks.c2a)
    correction = networks.recipe.integral_gain
    act(
        benchmark,
        networks.arm,
        CorrectedController(controller, correction) if correction else controller,
    )


def test_inverse_pcc(benchmark, arm):
    act(benchmark, arm, InversePCC(PCC.of(arm), jnp.ones(arm.module_count)))


def act(benchmark, arm, controller: Controller) -> None:
    sensed = jnp.asarray(straight(arm.module_count))
    act = compiled(_act, controller)
    memory = controller.start(sensed)
    benchmark(lambda: jax.block_until_ready(act(sensed, sensed, memory)))


def _act(controller: Controller, desired, sensed, memory):
    return controller.act(desired, sensed, memory)


@pytest.mark.asked("at most 2 ms, 99 %: 4 ms")
@pytest.mark.parametrize(
    "where", ["free", "past two obstacles", "past them, whole arm guarded"]
)
def test_tick(benchmark, networks, where):
    task = circle(networks.arm) if where == "free" else reach(networks.arm, "risk-a")
    benchmark(ticks_on(networks, task, "arm" if "whole" in where else "tip"))
