"""Recordings on disk: one HDF5 file, episode by episode, readable after a kill at any moment.

The datasets are laid out in full when the file is made, so that adding an episode changes no structure; a counter
says how many episodes are whole, and readers look no further.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.errors import DamagedRecordingError, RecordingError
from s2c2a.files import written_whole

SCHEMA = 1
UNITS = {"time": "s", "actions": "m or N", "cables": "m or N", "states": "m, 1", "configurations": "1"}


@dataclass(frozen=True)
class Recording:
    """What an arm did. Sample t holds the reading before its action is sent.

    Attributes:
        arm: the arm that was recorded.
        options: how it was collected: babbling, episodes, samples, seed, body, version.
        time: [s], shape (episodes, samples).
        actions: as really sent [m or N], shape (episodes, samples, modules, cables).
        cables: measured [m or N], shape (episodes, samples, modules, cables).
        states: true states, shape (episodes, samples, modules, 6); NaN where nothing watched.
        configurations: true configurations, shape (episodes, samples, modules, 3); NaN as above.
    """

    arm: ArmSpec
    options: dict
    time: Float[np.ndarray, "episodes samples"]
    actions: Float[np.ndarray, "episodes samples modules cables"]
    cables: Float[np.ndarray, "episodes samples modules cables"]
    states: Float[np.ndarray, "episodes samples modules 6"]
    configurations: Float[np.ndarray, "episodes samples modules 3"]

    def check_complete(self) -> None:
        """Raise RecordingError if episodes are missing: a staged recording cut short knows only its first stages."""
        if len(self.time) < self.options["episodes"]:
            raise RecordingError(
                f"this recording has {len(self.time)} of {self.options['episodes']} episodes; "
                "go on with `s2c2a collect --resume`"
            )


def load_recording(path: str | os.PathLike) -> Recording:
    """Read the whole episodes of a recording.

    Raises:
        RecordingError: no such file, in use, without one whole episode.
        DamagedRecordingError: not a recording, cut off, or not of the shape that it says.
    """
    with _opened(path) as file:
        try:
            arm, options = arm_from_toml(str(file.attrs["arm"]), f"arm in {path}"), read_options(file)
            committed = int(file["committed"][()])
            arrays = {name: file[name][:committed] for name in UNITS}
        except (KeyError, OSError, TypeError, ValueError, RuntimeError) as error:
            raise DamagedRecordingError(f"{path} is damaged inside ({error}); collect it anew") from error
    if committed == 0:
        raise RecordingError(f"{path} holds no whole episode yet; go on with `s2c2a collect --resume`")
    expected = {name: (committed, *shape) for name, shape in _shapes(arm, options).items()}
    wrong = [name for name, array in arrays.items() if array.shape != expected[name]]
    if wrong or not (np.isfinite(arrays["actions"]).all() and np.isfinite(arrays["cables"]).all()):
        raise DamagedRecordingError(
            f"{path} is damaged: wrong shape or numbers ({wrong or 'not finite'}); collect it anew"
        )
    return Recording(arm, options, **arrays)


def read_options(file: h5py.File) -> dict:
    """How a recording was collected."""
    return {name.removeprefix("option."): _plain(file.attrs[name]) for name in file.attrs if name.startswith("option.")}


class RecordingWriter:
    """An open recording that grows by whole episodes.

    Attributes:
        committed: number of whole episodes in the file.
    """

    def __init__(self, path: str | os.PathLike):
        """Open an existing recording to go on with it; raises RecordingError if it cannot be read."""
        self._file = _opened(path, "r+")
        self.committed = int(self._file["committed"][()])

    @classmethod
    def create(cls, path: str | os.PathLike, arm: ArmSpec, options: dict) -> "RecordingWriter":
        """Lay out a new file under another name and move it into place once it is sound."""
        try:
            with written_whole(path) as part, h5py.File(part, "w", libver="earliest") as file:
                _lay_out(file, arm, options)
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error}; choose another place") from error
        return cls(path)

    def append(self, episode: dict[str, np.ndarray]) -> None:
        """Write an episode, then count it."""
        for name, values in episode.items():
            self._file[name][self.committed] = values
        self._file.flush()
        self.committed += 1
        self._file["committed"][()] = self.committed
        self._file.flush()

    def arm_and_options(self) -> tuple[str, dict]:
        """What the file was begun with: arm as TOML, options."""
        return self._file.attrs["arm"], read_options(self._file)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _lay_out(file: h5py.File, arm: ArmSpec, options: dict) -> None:
    file.attrs.update({"schema": SCHEMA, "arm": arm_to_toml(arm)})
    file.attrs.update({f"option.{name}": value for name, value in options.items()})
    for name, shape in _shapes(arm, options).items():
        layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        layout.set_obj_track_times(False)  # the same data, the same file to the last byte
        space = h5py.h5s.create_simple((options["episodes"], *shape))
        h5py.h5d.create(file.id, name.encode(), h5py.h5t.NATIVE_DOUBLE, space, dcpl=layout)
        file[name].attrs["unit"] = UNITS[name]
    file["committed"] = np.int64(0)


def _shapes(arm: ArmSpec, options: dict) -> dict[str, tuple[int, ...]]:
    """Shape of one episode of every dataset."""
    modules, cables = arm.module_count, (arm.module_count, arm.cable_count)
    features = {"time": (), "actions": cables, "cables": cables, "states": (modules, 6), "configurations": (modules, 3)}
    return {name: (options["samples"], *shape) for name, shape in features.items()}


def _opened(path: str | os.PathLike, mode: str = "r") -> h5py.File:
    if not Path(path).is_file():
        raise RecordingError(f"no recording at {path}; make one with `s2c2a collect`")
    try:
        file = h5py.File(path, mode)
    except BlockingIOError as error:
        raise RecordingError(f"{path} is in use by another process; wait for it, or take another name") from error
    except OSError as error:
        raise DamagedRecordingError(
            f"{path} cannot be read as HDF5 ({error}); it is cut off, damaged, or no recording: collect it anew"
        ) from error
    try:
        missing = sorted({"committed", *UNITS} - set(file)) + [name for name in ("arm",) if name not in file.attrs]
        schema = file.attrs.get("schema")
    except (OSError, RuntimeError, KeyError) as error:
        file.close()
        raise DamagedRecordingError(f"{path} is damaged inside ({error}); collect it anew") from error
    if missing or schema != SCHEMA:
        file.close()
        raise DamagedRecordingError(
            f"{path} is not a recording of schema {SCHEMA} (schema {schema}, missing {missing})"
        )
    return file


def _plain(value):
    return value.item() if isinstance(value, np.generic) else value
