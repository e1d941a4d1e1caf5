"""An arm of ideal arcs, which follows every command at once."""

from collections.abc import Callable, Iterable
from functools import cache

import jax
import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.goals import Goal
from s2c2a.kinematics import PCC, states_from_bends
from s2c2a.spaces import Reading

Shape = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def drive_ideal(
    driver, arm: ArmSpec, goals: Iterable[Goal]
) -> tuple[np.ndarray, np.ndarray]:
    """Bends and states after every goal, shapes (steps, modules, 2) and (steps, modules, 6)."""
    shape = _shape_of(arm)
    command = np.asarray(PCC.of(arm).neutral, float)
    bends, states = shape(command)
    driver.start(_reading(command, states))
    rows = []
    for goal in goals:
        estimate = driver.estimate(_reading(command, states), command)
        command = driver.act(driver.plan(estimate, goal), estimate)
        bends, states = shape(command)
        rows.append((bends, states))
    all_bends, all_states = zip(*rows, strict=True)
    return np.array(all_bends), np.array(all_states)


def ideal_recording(arm, samples: int = 2000) -> Recording:
    """A recording of ideal arcs in shapes that fill their limits."""
    pcc, geometry = PCC.of(arm), ArmGeometry.of(arm)
    rng = np.random.default_rng(0)
    bends = rng.normal(size=(samples, arm.module_count, 2))
    bends *= 0.4 * geometry.planned_bends[:, None]
    cables = np.asarray(pcc.actions(np.asarray(bends, np.float32)), float)
    bends = np.asarray(pcc.bends(np.asarray(cables, np.float32)))
    states = jax.jit(states_from_bends)(bends, geometry.lengths.astype(np.float32))
    columns = {
        "time": 0.1 * np.arange(samples),
        "actions": cables,
        "sensor.cables": cables,
        "sensor.states": np.asarray(states, float),
    }
    return Recording(arm, {"episodes": 1}, (Episode(arm, columns),))


def _reading(command: np.ndarray, states: np.ndarray) -> Reading:
    return Reading(0.0, {"cables": command, "states": states})


@cache
def _shape_of(arm: ArmSpec) -> Shape:
    """Bends and states of commands; compiled, since a step would take long without."""
    pcc, lengths = PCC.of(arm), ArmGeometry.of(arm).lengths.astype(np.float32)

    @jax.jit
    def compute(command):
        bends = pcc.bends(command)
        return bends, states_from_bends(bends, lengths)

    def shape(command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bends, states = compute(command.astype(np.float32))
        return np.asarray(bends), np.asarray(states, float)

    return shape
