"""Data that the calibration of the uncertainty hides from its second training."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from s2c2a.data.windows import stretches
from s2c2a.kinematics import configurations_from_bends
from s2c2a.models import calibration, local_training
from s2c2a.models.chain_training import hysteresis_samples
from s2c2a.models.local_training import LocalOptions
from s2c2a.training import TrainingData

SAMPLES = 400
EPISODES = 3


@pytest.fixture(scope="module")
def data(make_arm) -> TrainingData:
    """Random walks; the first episode is at rest for half of its time."""
    arm = make_arm(2)
    random = np.random.default_rng(0)
    bends = np.cumsum(random.normal(0, 0.05, (EPISODES, SAMPLES, 2, 2)), axis=1)
    bends = 0.6 * np.sin(bends)
    bends[0, SAMPLES // 2 :] = bends[0, SAMPLES // 2]
    sensed = np.asarray(configurations_from_bends(bends.astype(np.float32)))
    actions = np.zeros((*sensed.shape[:-1], arm.cable_count))
    states = random.normal(0, 0.1, (*sensed.shape[:-1], 6))
    return TrainingData(arm, sensed, actions, states)


def test_each_group_has_its_share_even_if_the_arm_rests_for_longer(data):
    groups = calibration.held_out_groups(data)
    share = calibration.SHARE * EPISODES * SAMPLES
    assert {name: int(mask.sum()) for name, mask in groups.items()} == dict.fromkeys(
        groups, round(share)
    )
    slower = groups[calibration.SLOWER]
    assert slower[0, SAMPLES // 2 :].sum() == slower.sum()


def test_padding_is_no_slow_motion(data):
    """The moving part of the last piece counts alone."""
    padded = replace(
        data,
        lengths=(SAMPLES // 2, SAMPLES, SAMPLES - 40),
        sensed=data.sensed.copy(),
    )
    padded.sensed[2, SAMPLES - 40 :] = padded.sensed[2, SAMPLES - 41]
    bends = np.random.default_rng(0).normal(size=(1, 60))
    usable = np.arange(60)[None] < 45
    means = calibration._mean_over_pieces(bends, usable, 50)
    assert means[0, 0] == pytest.approx(bends[0, :45].mean())
    for mask in calibration.held_out_groups(padded).values():
        assert not mask[0, SAMPLES // 2 :].any()
        assert not mask[2, SAMPLES - 40 :].any()


def test_hidden_samples_are_no_data_of_the_second_model(data):
    """They keep their places in its training, but do not count as known regions."""
    options = LocalOptions(
        hidden=4, depth=1, play_widths=(0.05,), creep_times=(2.0,), points=60, few=40
    )
    hidden = calibration.union(calibration.held_out_groups(data))
    chain = options.untrained(data.arm, jax.random.key(0)).chain
    split = hysteresis_samples(chain, replace(data, hidden=hidden))
    seen = local_training._seen(split)
    count = sum(
        len(part.targets) for part in (seen.training, seen.validation, seen.test)
    )
    used = np.zeros_like(hidden)
    for part in stretches([SAMPLES] * EPISODES):
        for episode, span in part:
            used[episode, span] = True
    assert count == (used & ~hidden).sum()
    assert np.isfinite(seen.training.targets).all()
    assert len(seen.training.inputs["configurations"]) == len(seen.training.targets)
