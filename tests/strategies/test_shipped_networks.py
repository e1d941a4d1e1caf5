"""The networks that come with the package."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import StrategyError
from s2c2a.evaluation import position_errors, rollout
from s2c2a.live.control import strategies_of
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import (
    load_networks,
    recipe_named,
    s2c2a_strategy,
    shipped_networks,
)
from s2c2a.strategies.checkpoint import SHIPPED
from s2c2a.strategies.s2c2a import WEIGHTS
from s2c2a.tasks import circle

from marks import slow_after

# cm; README says 0.28 and 0.05 over five seeds
PRESETS = {"twin_arm": 0.4, "simulated_arm": 0.15}


@pytest.mark.parametrize(("name", "most"), slow_after(1, PRESETS.items()))
def test_they_drive_the_circle(name, most):
    arm = load_arm(name)
    task = circle(arm)
    run = rollout(SimulatedRobot(arm), s2c2a_strategy(shipped_networks(arm)), task)
    assert (
        np.mean(position_errors(run.after("states"), task.desired_positions())) < most
    )


@pytest.mark.parametrize("name", PRESETS)
def test_they_were_trained_by_the_recipe_as_it_is(name):
    networks = load_networks(WEIGHTS / f"{name}.safetensors", load_arm(name))
    assert networks.seed == 0
    assert networks.recipe.training == recipe_named("best").training
    assert shipped_networks(load_arm(name)).recipe == recipe_named("best")


def test_another_arm_is_told_to_train(make_arm):
    with pytest.raises(StrategyError, match="s2c2a train"):
        shipped_networks(make_arm(2))


def test_what_differs_from_the_arm_that_networks_come_for_is_named():
    twin = load_arm("twin_arm")
    loaded = twin.model_copy(update={"tip": twin.tip.model_copy(update={"mass": 0.02})})
    with pytest.raises(StrategyError, match=r"'twin_arm' in tip .*0\.02"):
        shipped_networks(loaded)


def test_another_step_limit_needs_no_training():
    faster = load_arm("twin_arm").model_copy(update={"step_limit_deg": 8.0})
    assert shipped_networks(faster).arm == faster


def test_the_live_page_takes_them_by_name():
    strategies = strategies_of(load_arm("twin_arm"), (SHIPPED,), "tip")
    assert next(iter(strategies)).endswith(SHIPPED)
