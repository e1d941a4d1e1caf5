"""Datasets of Minari, for offline reinforcement learning."""

import os
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.cli.export_table import units_of
from s2c2a.episodes import Episode, load_episodes
from s2c2a.episodes.episode import SENSOR
from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.folders import new_folder
from s2c2a.integrations.exports.targets import held
from s2c2a.integrations.extras import needs_extra

PLACE = "MINARI_DATASETS_PATH"
"""Variable with the folder of Minari's datasets."""


def write_minari(file: Path, out: Path) -> str:
    """Write a recording as a Minari dataset in a folder of datasets.

    Observations are the readings of all sensors and the targets; an episode has one
    observation more than actions: the last action has no reading behind it, and is left
    out. Rewards are zero: Minari needs some, and a recording has none.

    Raises:
        S2C2AError: the extra `minari` is missing, the folder exists, or an episode has
            fewer than two steps.
    """
    with needs_extra("minari", "the form minari"):
        import minari  # noqa: PLC0415  # an extra
        from gymnasium.spaces import Dict  # noqa: PLC0415
        from minari.data_collector import EpisodeBuffer  # noqa: PLC0415
    episodes, _ = load_episodes(file)
    if min(map(len, episodes)) < 2:
        raise S2C2AError(
            f"{file} has an episode of one step, and a transition needs two; record "
            "longer episodes"
        )
    observations = _observations(episodes)
    buffers = [
        EpisodeBuffer(
            id=number,
            observations={name: each[number] for name, each in observations.items()},
            actions=episode["actions"][:-1].astype(np.float32),
            rewards=[0.0] * (len(episode) - 1),
            terminations=[False] * (len(episode) - 1),
            truncations=[*[False] * (len(episode) - 2), True],
            infos={"time": episode["time"].tolist()},
        )
        for number, episode in enumerate(episodes)
    ]
    name = dataset_name(file)
    with (
        new_folder(out.absolute()) as folder,  # Minari joins relative paths twice
        _datasets_in(folder),
        warnings.catch_warnings(action="ignore", category=UserWarning),
    ):
        # it warns of each statement that is missing, such as an author
        minari.create_dataset_from_buffers(
            name,
            buffers,
            action_space=_space(episodes[0]["actions"]),
            observation_space=Dict(
                {name: _space(each[0]) for name, each in observations.items()}
            ),
            data_format="arrow",
            description=_description(episodes, ["actions", *observations]),
        )
    return f"{len(episodes)} episodes of '{name}'"


def dataset_name(file: Path) -> str:
    """Name of the dataset of a recording: Minari wants a version behind it."""
    return f"{re.sub('[^-_a-zA-Z0-9]', '-', file.stem)}-v0"


@contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Make a folder that of Minari's datasets, which it takes from the environment."""
    before = os.environ.get(PLACE)
    os.environ[PLACE] = str(folder)
    try:
        yield
    finally:
        del os.environ[PLACE]
        if before is not None:
            os.environ[PLACE] = before


def _observations(episodes: Sequence[Episode]) -> dict[str, list[np.ndarray]]:
    """Readings and targets of every episode, by column that all of them have."""
    common = set.intersection(*(set(episode.columns) for episode in episodes))
    names = [name for name in episodes[0].columns if name in common]
    observations = {}
    for name in names:
        if name.startswith((SENSOR, "desired_")):
            columns = [episode[name].astype(np.float32) for episode in episodes]
            if name.startswith("desired_"):
                columns = [_held(values) for values in columns]
            observations[name] = columns
    return observations


def _held(values: np.ndarray) -> np.ndarray:
    return held(values.reshape(len(values), -1)).reshape(values.shape)


def _space(values: np.ndarray) -> Any:
    from gymnasium.spaces import Box  # noqa: PLC0415  # an extra

    return Box(-np.inf, np.inf, values.shape[1:], np.float32)


def _description(episodes: Sequence[Episode], names: Sequence[str]) -> str:
    """Units of all spaces."""
    units = units_of(episodes)
    known = [f"{name} [{units[name]}]" for name in names if name in units]
    return (
        f"Recording of '{episodes[0].arm.name}' at {episodes[0].arm.control_rate:g} Hz; "
        f"{', '.join(known)}; rewards are zero, and NaN is not measured"
    )
