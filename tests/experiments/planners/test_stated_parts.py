"""What strategies state to ignore has no influence on them, and all else has."""

from typing import get_args

import jax
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.goals import Goal, GoalPart
from s2c2a.plugins.discovery import installed
from s2c2a.strategies import (
    STRATEGIES,
    RunOptions,
    TrainedNetworks,
    recipe_named,
    strategy_named,
)
from s2c2a.training import Trained

from ideal_arm import drive_ideal, ideal_recording

ARM = load_arm("planar_finger")
RECIPE = recipe_named("best")
STEPS = 12
SMALL = {
    "inverse-sampling": "inverse-sampling,samples=6",
    "multi-ik": "multi-ik,solutions=4",
    "rrt-star": "rrt-star,neighbors=4,waiting=3",
}
"""Options with which strategies take less time."""
TIP = np.array([0.0, 0.0, ARM.length])
TARGET = ARM.length * np.array([0.3, 0.0, 0.9])
PLAIN = Goal.of(ARM.module_count).with_position(TARGET)
GOALS = {
    "axes": PLAIN.with_axis([1.0, 0.0, 0.2]),
    "other ends": PLAIN.with_position([0.0, 0.0, ARM.modules[0].length], module=0),
    # around the straight tip, too
    "obstacles": PLAIN.with_obstacles([0.5 * (TARGET + TIP)], [0.25 * ARM.length]),
}
"""By part of a goal: a goal that has it, beside the same position of the tip."""


def built(name: str):
    """Options and driver of a name, with untrained networks if it has some."""
    options = strategy_named(SMALL.get(name, name))
    recipe = options.recipe(RECIPE)
    blank = options.untrained(ARM, recipe, jax.random.key(0))
    networks = {key: Trained(network) for key, network in blank.items()}
    trained = TrainedNetworks(ARM, recipe, 0, networks) if networks else None
    if name == "gmr":  # its mixture knows axes by what it was fitted to
        trained = options.train(ideal_recording(ARM), recipe, 0)
    return options, options.build(ARM, recipe, trained, RunOptions())


def test_every_part_of_a_goal_is_tried():
    assert set(GOALS) == set(get_args(GoalPart))
    for part, goal in GOALS.items():
        assert goal.parts == {part}


@pytest.mark.parametrize("name", sorted({*STRATEGIES.known, *installed("strategy")}))
def test_a_strategy_ignores_what_it_states_and_nothing_else(name):
    options, driver = built(name)
    bends, _ = drive_ideal(driver, ARM, [PLAIN] * STEPS)
    changed = {}
    for part, goal in GOALS.items():
        others, _ = drive_ideal(driver, ARM, [goal] * STEPS)
        changed[part] = not np.array_equal(others, bends)
    stated = {part: part not in options.ignores for part in GOALS}
    assert changed == stated
