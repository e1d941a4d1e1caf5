"""Regression in a Gaussian mixture of what was recorded."""

import sys
from dataclasses import replace

import jax
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError, S2C2AError, StrategyError
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import RunOptions, load_networks, recipe_named, save_networks
from s2c2a.strategies.registry import labeled
from s2c2a.training import Trained
from s2c2a_experiments.planners.gaussian_mixture import MIXTURE, GaussianMixture

from ideal_arm import drive_ideal, ideal_recording

OPTIONS = GaussianMixture(components=12)
RECIPE = recipe_named("paper")
SHAPES = [
    [[0.5, 0.1], [0.1, 0.3], [-0.3, 0.4]],
    [[-0.2, -0.4], [0.3, -0.3], [0.2, 0.1]],
]


@pytest.fixture(scope="module")
def trained(twin):
    return labeled(OPTIONS.train(ideal_recording(twin), RECIPE, 0), OPTIONS)


def driven(arm, trained, goals) -> tuple[np.ndarray, np.ndarray]:
    driver = OPTIONS.build(arm, RECIPE, trained, RunOptions())
    return drive_ideal(driver, arm, goals)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_it_reaches_targets_with_and_without_axes(twin, trained, shape):
    lengths = ArmGeometry.of(twin).lengths.astype(np.float32)
    tip = np.asarray(jax.jit(states_from_bends)(np.array(shape, np.float32), lengths))[
        -1
    ]
    goal = Goal.of(3).with_position(tip[:3])
    _, states = driven(twin, trained, [goal] * 40)
    assert np.linalg.norm(states[-1, -1, :3] - tip[:3]) < 0.03 * twin.length
    _, states = driven(twin, trained, [goal.with_axis(tip[3:])] * 40)
    assert np.linalg.norm(states[-1, -1, :3] - tip[:3]) < 0.04 * twin.length
    assert states[-1, -1, 3:] @ tip[3:] > np.cos(np.deg2rad(6.0))


def test_without_a_target_it_holds_still_and_every_run_is_the_same(twin, trained):
    goals = [Goal.of(3).with_position([0.2, 0.1, 0.5])] * 5 + [Goal.of(3)] * 5
    bends, _ = driven(twin, trained, goals)
    np.testing.assert_allclose(bends[5:], bends[4:5].repeat(5, axis=0), atol=1e-5)
    np.testing.assert_array_equal(bends, driven(twin, trained, goals)[0])


def test_saved_and_loaded_it_plans_the_same(twin, trained, tmp_path):
    save_networks(trained, tmp_path / "gmr.safetensors")
    loaded = load_networks(tmp_path / "gmr.safetensors", twin)
    goals = [Goal.of(3).with_position([0.2, 0.1, 0.5])] * 5
    before, after = (driven(twin, found, goals)[0] for found in (trained, loaded))
    np.testing.assert_array_equal(before, after)


def test_too_few_samples_no_networks_and_bad_covariances_are_explained(twin, trained):
    [episode] = ideal_recording(twin, samples=50).episodes
    states = np.array(episode["sensor.states"])
    states[3:5] = np.nan  # unknown
    columns = {**episode.columns, "sensor.states": states}
    recording = Recording(twin, {"episodes": 1}, (Episode(twin, columns),))
    with pytest.raises(
        RecordingError, match=r"12 components need 120 samples .* has 48"
    ):
        OPTIONS.train(recording, RECIPE, 0)
    with pytest.raises(StrategyError, match="needs a mixture"):
        OPTIONS.build(twin, RECIPE, None, RunOptions())
    mixture = trained.networks[MIXTURE]
    negative = type(mixture)(mixture.weights, mixture.means, -mixture.covariances)
    trained = OPTIONS.train(ideal_recording(twin, 200), RECIPE, 0)
    trained = replace(trained, trained={MIXTURE: Trained(negative)})
    with pytest.raises(StrategyError, match="not positive definite"):
        OPTIONS.build(twin, RECIPE, trained, RunOptions())


def test_a_missing_package_names_its_extra(twin, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(S2C2AError, match=r"s2c2a\[planners\]"):
        OPTIONS.train(ideal_recording(twin, 200), RECIPE, 0)
