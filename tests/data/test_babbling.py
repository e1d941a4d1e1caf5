"""Babbling: who moves alike in which stage, how fast, within which limits."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.data import BABBLING, episode_actions
from s2c2a.data.babbling import SPEEDS, Exploration, motion_through
from s2c2a.data.nominal_plans import nominal_plans
from s2c2a.kinematics import states_from_bends
from s2c2a.paper import bend_path, disc_points

from marks import slow_after

SAMPLES = 300


def shares(
    arm, babbling: str, episode: int, episodes: int = 6, seed: int = 0
) -> np.ndarray:
    """Commanded shares of the full bend, shape (samples, modules, 2)."""
    geometry = ArmGeometry.of(arm)
    actions = episode_actions(geometry, babbling, episode, episodes, SAMPLES, seed)
    return np.einsum(
        "mkc,smc->smk",
        geometry.bend_matrices,
        (actions - geometry.action_neutral) / geometry.action_scale[:, None],
    )


def tension_arm(make_arm, modules, cables, pretension=30.0):
    return make_arm(
        modules,
        cables,
        {"pretension": pretension, "tension_range": 12.0},
        actuation="tension",
    )


@pytest.mark.parametrize("babbling", BABBLING)
@pytest.mark.parametrize("cables", slow_after(1, [4, 3, 5, 8]))
def test_actions_stay_within_the_limits_and_use_most_of_them(
    make_arm, babbling, cables
):
    for arm in (
        make_arm(3, cables),
        tension_arm(make_arm, 3, cables),
        tension_arm(make_arm, 3, cables, 4.0),
    ):
        geometry = ArmGeometry.of(arm)
        actions = np.stack(
            [
                episode_actions(geometry, babbling, episode, 6, SAMPLES, 0)
                for episode in range(6)
            ]
        )
        assert actions.shape == (6, SAMPLES, 3, cables)
        assert (actions >= geometry.action_low).all()
        assert (actions <= geometry.action_high).all()
        used = np.ptp(actions, axis=(0, 1)) / (
            geometry.action_high - geometry.action_low
        )
        assert used.min() > 0.8


def test_bends_stay_within_the_disc_and_reach_its_rim_in_every_direction(twin):
    asked = np.concatenate(
        [shares(twin, "motor", episode)[:, 0] for episode in range(6)]
    )
    directions = np.arctan2(asked[:, 1], asked[:, 0])
    lengths = np.linalg.norm(asked, axis=-1)
    farthest = [
        lengths[np.abs(directions - center) < np.pi / 8].max()
        for center in np.linspace(-2.7, 2.7, 8)
    ]
    assert lengths.max() <= 1 + 1e-9
    assert min(farthest) > 0.8


@pytest.mark.parametrize("preset", ["twin", "simulated"])
@pytest.mark.parametrize("episode", [0, 1])
def test_in_the_first_third_all_modules_bend_alike(preset, episode, request):
    """Alike in bend, whatever the angles of their cables."""
    asked = shares(request.getfixturevalue(preset), "staged", episode)
    np.testing.assert_allclose(asked, np.repeat(asked[:, :1], 3, axis=1), atol=1e-9)
    assert np.ptp(asked[:, 0], axis=0).min() > 0.5


@pytest.mark.parametrize(
    ("babbling", "episode"), [("staged", 4), ("staged", 5), ("motor", 0), ("motor", 3)]
)
def test_in_the_last_third_and_in_motor_babbling_every_module_has_its_own_path(
    twin, babbling, episode
):
    asked = shares(twin, babbling, episode)
    apart = np.linalg.norm(asked - asked[:, [1, 2, 0]], axis=-1)
    assert apart.mean(axis=0).min() > 0.2


def test_eighteen_episodes_are_six_per_stage(twin):
    kinds = []
    for episode in range(18):
        asked = shares(twin, "staged", episode, episodes=18)
        kinds.append(len(np.unique(np.round(asked[50], 6), axis=0)))
    assert kinds == [1] * 6 + [2] * 6 + [3] * 6


def test_no_step_exceeds_the_fastest_speed():
    for speeds in (SPEEDS, (0.02, 0.06)):
        paths = [
            bend_path(500, np.random.default_rng(seed), speeds) for seed in range(10)
        ]
        steps = [
            np.linalg.norm(np.diff(path, axis=0, prepend=0.0), axis=-1)
            for path in paths
        ]
        assert np.max(steps) <= speeds[1] * (1 + 1e-9)
        assert np.max(steps) > 0.9 * speeds[1]


def lines(seed: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed and number of steps of a path's inner line segments."""
    steps = np.diff(
        bend_path(samples, np.random.default_rng(seed)), axis=0, prepend=0.0
    )
    turns = np.flatnonzero(np.linalg.norm(np.diff(steps, axis=0), axis=-1) > 1e-9) + 1
    return np.linalg.norm(steps[turns[:-1]], axis=-1), np.diff(turns)


def test_lines_are_no_slower_than_the_slowest_speed():
    """Rounding up to n whole steps leaves at least (n - 1) / n of the speed."""
    speeds, counts = lines(seed=0, samples=5000)
    assert len(counts) > 100
    assert np.all(speeds >= SPEEDS[0] * (counts - 1) / counts)


def test_speeds_are_mixed_evenly_on_a_logarithmic_scale():
    """Judged by long lines, since short ones are rounded."""
    speeds, counts = lines(seed=1, samples=40000)
    places = np.log(speeds[counts > 3] / SPEEDS[0]) / np.log(SPEEDS[1] / SPEEDS[0])
    np.testing.assert_allclose(
        np.quantile(places, [0.25, 0.5, 0.75]), [0.25, 0.5, 0.75], atol=0.12
    )


def test_points_of_the_disc_are_uniform():
    """Half of them lie within 1 / sqrt(2) of the center, a quarter in each quadrant."""
    random = np.random.default_rng(0)
    points = disc_points(random, (8000,))
    assert np.mean(np.linalg.norm(points, axis=-1) < 0.5**0.5) == pytest.approx(
        0.5, abs=0.02
    )
    assert np.mean((points > 0).all(axis=-1)) == pytest.approx(0.25, abs=0.02)
    assert np.linalg.norm(points, axis=-1).max() <= 1


def opposed(asked: np.ndarray) -> float:
    """Share of the samples in which the first two modules bend in opposite directions."""
    inner, outer = asked[:, 0], asked[:, 1]
    product = np.sum(inner * outer, axis=-1)
    lengths = np.linalg.norm(inner, axis=-1) * np.linalg.norm(outer, axis=-1)
    return float(np.mean(product < -0.5 * lengths))


def test_coverage_has_opposed_bends_from_the_first_episode_on(twin):
    """Staged babbling begins with equal bends of all modules."""
    covering = [shares(twin, "coverage", episode, 18) for episode in range(3)]
    staged = [shares(twin, "staged", episode, 18) for episode in range(3)]
    assert np.mean([opposed(asked) for asked in covering]) > 0.08
    assert np.mean([opposed(asked) for asked in staged]) < 0.02


def test_coverage_has_slow_stretches_and_holds(twin):
    asked = np.concatenate(
        [shares(twin, "coverage", number, 18) for number in range(9)]
    )
    speeds = np.linalg.norm(np.diff(asked, axis=0), axis=-1).max(axis=-1)
    assert 0.02 < np.mean(speeds < 1e-9) < 0.3
    assert 0.02 < np.mean((speeds > 1e-9) & (speeds < 0.5 * SPEEDS[0])) < 0.4


def test_targets_are_visited_one_after_the_other(twin):
    random = np.random.default_rng(3)
    targets = disc_points(random, (3, 3))
    motion = Exploration(ArmGeometry.of(twin), 0.0, SAMPLES, random, (0.2, 0.3))
    distances = np.abs(motion_through(targets, motion)[:, None] - targets)
    assert distances.max(axis=(-2, -1)).min(axis=0).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("modules", slow_after(1, [2, 1, 4]))
def test_nominal_plans_reach_their_workspace_evenly(make_arm, modules):
    geometry = ArmGeometry.of(make_arm(modules))
    plans = nominal_plans(geometry, 200, np.random.default_rng(0))
    assert np.linalg.norm(plans, axis=-1).max() <= 1.0 + 1e-9
    tips = np.asarray(
        states_from_bends(plans * geometry.action_bends[:, None], geometry.lengths)
    )[:, -1, :3]
    assert np.ptp(tips[:, :2], axis=0).min() > 0.3 * geometry.lengths.sum()
