"""Recordings: many episodes of one arm, from which networks learn."""

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
from s2c2a.errors import RecordingError
from s2c2a.spaces import Reading

LARGEST = 1e6
"""A number of a sensor, or an action [m or N], beyond this is no measurement."""


@dataclass(frozen=True, eq=False)
class Recording:
    """What an arm did, from rest, several times. Sample t holds the reading before its action is sent.

    Attributes:
        arm: the arm that was recorded.
        options: how it was collected: babbling, episodes, samples, seed, body, version.
        episodes: one or more.
    """

    arm: ArmSpec
    options: Mapping[str, Any]
    episodes: tuple[Episode, ...]

    @property
    def lengths(self) -> tuple[int, ...]:
        """Samples of each episode; logs with gaps have them of different lengths, and arrays of all repeat the last."""
        return tuple(map(len, self.episodes))

    @cached_property
    def time(self) -> Float[np.ndarray, "episodes samples"]:
        """[s], since each episode began."""
        return stacked(self.episodes, "time")

    @cached_property
    def actions(self) -> Float[np.ndarray, "episodes samples modules cables"]:
        """As really sent [m or N]."""
        return stacked(self.episodes, "actions")

    @property
    def sensors(self) -> list[str]:
        """Names of those that every episode has."""
        return [
            name
            for name in self.episodes[0].sensors
            if all(name in one.sensors for one in self.episodes)
        ]

    def sensor(self, name: str) -> np.ndarray:
        """What a sensor said, shape (episodes, samples, ...).

        Raises:
            RecordingError: it was not measured in all of them.
        """
        if name not in self.sensors:
            raise RecordingError(
                f"this recording lacks '{name}'; it has {', '.join(self.sensors) or 'no sensors'}: record with it on"
            )
        return stacked(self.episodes, SENSOR + name)

    def readings(self) -> Reading:
        """All readings as one, the numbers of every sensor with (episodes, samples) in front."""
        return Reading(0.0, {name: self.sensor(name) for name in self.sensors})

    def check_complete(self) -> None:
        """Raise RecordingError if episodes are missing: a staged recording cut short knows only its first stages."""
        asked = self.options.get("episodes", 0)
        if not isinstance(asked, int) or len(self.episodes) < asked:
            raise RecordingError(
                f"this recording has {len(self.episodes)} of {asked} episodes; go on with `s2c2a collect --resume`"
            )


def load_recording(path: str | os.PathLike) -> Recording:
    """Read the whole episodes of a recording.

    Raises:
        RecordingError: no such file, without one whole episode, or with numbers that no
            arm can have said.
        DamagedRecordingError: not a file of episodes, cut off, or damaged.
    """
    episodes, options = load_episodes(Path(path))
    for episode in episodes:
        for name in ("actions", *(SENSOR + sensor for sensor in episode.sensors)):
            largest = np.nanmax(np.abs(episode[name].astype(float)), initial=0.0)
            if not largest < LARGEST:
                raise RecordingError(
                    f"{path}: '{name}' holds {largest:.3g}, which no arm says; measure it anew"
                )
    return Recording(episodes[0].arm, options, tuple(episodes))
