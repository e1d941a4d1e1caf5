"""Parts of a control step: sensing, control, and whole steps; see also `bench_plan`."""

import operator

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.control import Controller, CorrectedController, InversePCC, NetworkController
from s2c2a.execution.compilation import compiled
from s2c2a.kinematics import PCC
from s2c2a.tasks import circle
from s2c2a.tasks.lines import reach

from driving import straight, ticks_on


def test_sense(benchmark, networks):
    arm = networks.arm
    sense = compiled(operator.call, networks.recipe.estimator(arm))
    sensors = {"cables": np.zeros((arm.module_count, arm.cable_count), np.float32)}
    benchmark(lambda: jax.block_until_ready(sense(sensors)))


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
