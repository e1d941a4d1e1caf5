"""Recordings: episodes of one arm, used as training data."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode, load_episodes
from s2c2a.episodes.episode import SENSOR, stacked
from s2c2a.errors import RecordingError, counted
from s2c2a.files.text import LARGEST
from s2c2a.spaces import Reading


@dataclass(frozen=True, eq=False)
class Recording:
    """Episodes of one arm; sample t holds the reading before its action is sent.

    Attributes:
        arm: the recorded arm.
        options: options of the collection: babbling, episodes, samples, seed, robot,
            version.
        episodes: one or more episodes.
    """

    arm: ArmSpec
    options: Mapping[str, Any]
    episodes: tuple[Episode, ...]

    def __repr__(self) -> str:
        """Size and sensors, whose values are too many to read."""
        steps = sum(self.lengths)
        return (
            f"<Recording of {self.arm.name}: {counted(len(self.episodes), 'episode')}, "
            f"{counted(steps, 'step')}, {steps * self.arm.control_period:.1f} s; "
            f"sensors {', '.join(self.sensors)}>"
        )

    @property
    def lengths(self) -> tuple[int, ...]:
        """Number of samples of each episode.

        Arrays of all episodes repeat the last sample of shorter ones.
        """
        return tuple(map(len, self.episodes))

    @cached_property
    def time(self) -> Float[np.ndarray, "episodes samples"]:
        """Time since the start of each episode [s]."""
        return stacked(self.episodes, "time")

    @cached_property
    def actions(self) -> Float[np.ndarray, "episodes samples modules cables"]:
        """Actions that were sent [m or N]."""
        return stacked(self.episodes, "actions")

    @property
    def sensors(self) -> list[str]:
        """Names of the sensors that every episode has."""
        by_episode = (set(episode.sensors) for episode in self.episodes)
        return sorted(set.intersection(*by_episode))

    def sensor(self, name: str) -> np.ndarray:
        """Values of a sensor, shape (episodes, samples, ...).

        Raises:
            RecordingError: an episode lacks the sensor.
        """
        if name not in self.sensors:
            raise RecordingError(
                f"this recording lacks '{name}'; it has "
                f"{', '.join(self.sensors) or 'no sensors'}. Record with this sensor"
            )
        return stacked(self.episodes, SENSOR + name)

    def readings(self) -> Reading:
        """All sensors as one reading, each of shape (episodes, samples, ...)."""
        return Reading(0.0, {name: self.sensor(name) for name in self.sensors})

    def check_complete(self) -> None:
        """Check that no episode is missing, since each stage of babbling has its own.

        Raises:
            RecordingError: the recording has fewer episodes than requested.
        """
        requested = self.options.get("episodes", 0)
        if not isinstance(requested, int) or len(self.episodes) < requested:
            raise RecordingError(
                f"this recording has {len(self.episodes)} of {requested} episodes; "
                "complete it with `s2c2a collect --resume`"
            )


def load_recording(path: str | os.PathLike) -> Recording:
    """Read the complete episodes of a recording.

    Raises:
        RecordingError: the file does not exist, has no complete episode, or has invalid
            values.
        DamagedRecordingError: the file is not a recording, is cut off, or is damaged.
    """
    episodes, options = load_episodes(Path(path))
    for episode in episodes:
        for name in ("actions", *(SENSOR + sensor for sensor in episode.sensors)):
            largest = np.nanmax(np.abs(episode[name].astype(float)), initial=0.0)
            if not largest < LARGEST:
                raise RecordingError(
                    f"{path}: '{name}' has values up to {largest:.3g}; at most "
                    f"{LARGEST:.0e} is valid. Record it again"
                )
    return Recording(episodes[0].arm, options, tuple(episodes))
