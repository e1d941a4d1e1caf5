"""Scenes without a way: certified by construction, and told by the plan."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.jobs import Cache, Conditions, jobs_for, make_all
from s2c2a.robots import RobotFactory
from s2c2a.spaces import POSITION
from s2c2a.strategies import RunOptions, recipe_named, shipped_networks
from s2c2a_experiments import scenes
from s2c2a_experiments.scenes import UNSOLVABLE, unsolvable_task

TWIN = load_arm("twin_arm")
CERTIFIED = 0.03
"""Distance of all clear tips from a target [m]."""
POINT_DISTANCE = 0.04
"""Of two points of the center line that keep clear [m]."""


def scene(seed):
    """Target [m] and spheres [m] of an unsolvable scene."""
    task = unsolvable_task(TWIN, seed)
    goal = task.goals[0]
    spheres = goal.obstacles_in_use()
    return task.name, goal.positions[-1], spheres


@pytest.mark.parametrize("seed", range(20))
def test_the_arm_at_rest_is_clear_of_an_unsolvable_scene(seed):
    _, _, spheres = scene(seed)
    heights = np.linspace(0.0, TWIN.length, 100)
    line = np.stack([0.0 * heights, 0.0 * heights, heights], axis=1)
    gaps = np.linalg.norm(line[:, None] - spheres[:, :3], axis=-1) - spheres[:, 3]
    assert gaps.min() > 0.01


@pytest.mark.parametrize("seed", range(0, 20, 3))
def test_a_cage_is_closed_and_thicker_than_points_are_apart(seed):
    name, target, spheres = scene(seed)
    assert name.startswith("caged")
    directions = np.random.default_rng(seed).normal(size=(4000, 1, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    middle = scenes.CAGE * TWIN.length
    distances = middle + np.linspace(-0.5, 0.5, 9)[:, None] * POINT_DISTANCE
    points = target + distances * directions
    gaps = np.linalg.norm(points[:, :, None] - spheres[:, :3], axis=-1)
    assert (gaps < spheres[:, 3]).any(axis=-1).all()
    assert middle - POINT_DISTANCE / 2 > CERTIFIED


@pytest.mark.parametrize("seed", range(1, 20, 3))
def test_a_covered_target_is_deep_in_its_sphere(seed):
    name, target, (sphere,) = scene(seed)
    center, radius = sphere[:3], sphere[3]
    assert name.startswith("covered")
    assert radius - np.linalg.norm(target - center) > CERTIFIED


@pytest.mark.parametrize("seed", range(2, 20, 3))
def test_a_target_too_far_is_farther_than_the_arm_is_long(seed):
    name, target, spheres = scene(seed)
    assert name.startswith("too far")
    assert np.linalg.norm(target) > TWIN.length + CERTIFIED
    assert len(spheres)


@pytest.mark.slow
def test_a_plan_tells_that_a_covered_target_has_no_way(given, tmp_path, monkeypatch):
    monkeypatch.setattr(scenes, "SCENE_TIME", 3.0)
    conditions = Conditions(RobotFactory.simulation(), RunOptions("arm"))
    task = unsolvable_task(TWIN, UNSOLVABLE.index("covered"))
    recipe, weights = recipe_named("best"), given(shipped_networks(TWIN))
    jobs = jobs_for([task], TWIN, ["s2c2a"], [0], recipe, conditions, weights)
    runs = make_all(jobs, Cache(tmp_path / "data", tmp_path / "runs"))
    rows = scenes._shares_told("covered", runs)
    assert [row.mean for row in rows] == [1.0, 1.0]
    tip = runs[0].episode.after("states")[-1, -1, POSITION]
    assert np.linalg.norm(tip - task.goals[0].positions[-1]) > CERTIFIED
