"""Active choice of targets: where the data are missing, and where plans are."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.data.babbling import coverage_targets
from s2c2a.kinematics import configurations_from_bends, states_from_configurations
from s2c2a.models import active, kernels
from s2c2a.training import TrainingData


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(active, "CANDIDATES", 200)
    monkeypatch.setattr(active, "SAMPLES", 300)
    monkeypatch.setattr(kernels, "STEPS", 20)


def data_with(arm, bends: np.ndarray, known: bool = True) -> TrainingData:
    """Data of one episode through bends, in shares of the full bend."""
    geometry = ArmGeometry.of(arm)
    sensed = np.asarray(
        configurations_from_bends(bends * geometry.action_bends[:, None])
    )[None]
    states = np.asarray(states_from_configurations(sensed * 1.0, geometry.lengths))
    states = states + 0.01 * np.sin(5.0 * sensed.sum(axis=(-2, -1)))[..., None, None]
    if not known:
        states = np.full_like(states, np.nan)
    actions = np.zeros((*sensed.shape[:2], arm.module_count, arm.cable_count))
    return TrainingData(arm, sensed, actions, states)


@pytest.mark.parametrize("known", [True, False])
def test_targets_are_where_the_recording_was_not(small, make_arm, known):
    arm = make_arm(2)
    random = np.random.default_rng(0)
    bends = coverage_targets(ArmGeometry.of(arm), 300, random)
    bends[:, 0, 0] = -np.abs(bends[:, 0, 0])  # never to the other side
    targets = active.choose_targets(data_with(arm, bends, known), 20, seed=0)
    assert targets.shape == (20, 2, 2)
    assert np.mean(targets[:, 0, 0] > 0.0) > 0.7


def test_each_target_reduces_the_variance_the_most():
    """With two clusters of candidates, the second target lies in the other cluster."""
    near = np.eye(6)
    near[:4, :4] += 5.0
    near[4:, 4:] += 4.0
    first, second = active._most_informative(near, 2)
    assert first < 4
    assert second >= 4


def test_equal_data_and_seed_give_equal_targets(small, make_arm):
    arm = make_arm(2)
    bends = coverage_targets(ArmGeometry.of(arm), 300, np.random.default_rng(1))
    one, two = (active.choose_targets(data_with(arm, bends), 10, 4) for _ in range(2))
    np.testing.assert_array_equal(one, two)
