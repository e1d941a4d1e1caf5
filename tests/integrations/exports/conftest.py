"""A recording with everything that an export shows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from s2c2a.episodes import load_episodes, save_episodes

RECORDING = Path(__file__).parents[2] / "fixtures" / "twin.episodes"
TARGET = [0.1, 0.0, 0.5]
OBSTACLE = [0.3, 0.1, 0.4, 0.05]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two episodes; the second has targets in its last half, a ball and a lost end."""
    first, second = load_episodes(RECORDING)[0][:2]
    positions = np.full((len(second), 3, 3), np.nan)
    positions[len(second) // 2 :, -1] = TARGET
    states = np.array(second.sensor("states"))
    states[3, 1] = np.nan
    columns = {
        "desired_positions": positions,
        "obstacles": np.tile(OBSTACLE, (len(second), 1, 1)),
        "sensor.states": states,
    }
    second = replace(second, columns={**second.columns, **columns})
    path = tmp_path_factory.mktemp("exports") / "two.episodes"
    save_episodes([first, second.with_options(task="circle")], path, {})
    return path


@pytest.fixture(scope="module")
def episodes(recording):
    return load_episodes(recording)[0]
