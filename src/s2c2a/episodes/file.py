"""Files of episodes: `.episodes`, whole or not at all, checked before they are believed.

The first block's content (`blocks`) is JSON: schema, version, arm (TOML), options, how
many episodes follow if that is known. Every other one holds an episode in the
safetensors format, its options as JSON in the metadata. Nothing but arrays of numbers
is built.
"""

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import from_json
from safetensors import SafetensorError
from safetensors.numpy import load, save

import s2c2a
from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.episodes.blocks import (
    LENGTH,
    damaged,
    lock,
    opened_blocks,
    read_blocks,
    write_block,
)
from s2c2a.episodes.episode import Episode
from s2c2a.errors import DamagedRecordingError, RecordingError, S2C2AError
from s2c2a.files import written_whole

ENDING = ".episodes"
SCHEMA = 2
# bytes of what is said of all episodes: it grows when it is read
MAX_HEADERS = 10_000_000


def save_episodes(
    episodes: Iterable[Episode],
    path: str | os.PathLike,
    options: Mapping[str, Any] | None = None,
) -> Path:
    """Write episodes of one arm; the file appears whole or not at all.

    Raises:
        RecordingError: no episode, episodes of different arms, or the file cannot be
            written.
    """
    every = list(episodes)
    if not every or any(one.arm != every[0].arm for one in every):
        raise RecordingError(
            "a file of episodes holds at least one, all of the same arm"
        )
    with written_whole(path, RecordingError) as part, open(part, "wb") as file:
        before = write_block(file, _head(every[0].arm, options or {}, len(every)), b"")
        for episode in every:
            before = write_block(file, _packed(episode), before)
        file.flush()
        os.fsync(file.fileno())
    return Path(path)


def load_episodes(path: str | os.PathLike) -> tuple[list[Episode], dict[str, Any]]:
    """Read every episode of a file, and the options that it was begun with.

    Raises:
        RecordingError: no such file, or it holds no whole episode yet.
        DamagedRecordingError: no file of episodes, cut off in the middle, or one byte
            is not as it was written.
    """
    with opened_blocks(path) as file:
        blocks = read_blocks(file, path)
        arm, options, count = _read_head(next(blocks, (b"", b""))[0], path)
        episodes = []
        said = 0
        for content, _ in blocks:
            said += int.from_bytes(content[:LENGTH], "little")
            if said > MAX_HEADERS:
                raise damaged(
                    path,
                    f"what it says about its episodes has more than {MAX_HEADERS} bytes",
                )
            episodes.append(_unpacked(content, arm, path))
    if count is not None and len(episodes) != count:
        raise damaged(path, f"{len(episodes)} of {count} episodes are there")
    if not episodes:
        raise RecordingError(
            f"{path} holds no whole episode yet; go on with it (--resume), or begin anew (--overwrite)"
        )
    return episodes, options


class EpisodeWriter:
    """An open file that grows by whole episodes.

    Attributes:
        arm: whose episodes they are.
        options: that the file was begun with.
        count: number of whole episodes in it.
    """

    def __init__(self, path: str | os.PathLike):
        """Open a file to go on with it; a part of an episode at its end, as a kill leaves it, goes.

        Raises:
            RecordingError: no such file, a link to one, or it cannot be written.
            DamagedRecordingError: it is damaged before its end.
        """
        self._path = Path(path)
        if self._path.is_symlink():
            raise RecordingError(
                f"{path} is a link, and nothing is written through links; name the file itself"
            )
        self._file = opened_blocks(path, "r+b", buffering=0)
        try:
            lock(self._file, path)
            self._go_to_end()
        except BaseException:
            self._file.close()
            raise

    def _go_to_end(self) -> None:
        """Behind the last whole episode; what follows it goes."""
        self.count = -1
        whole = 0
        for content, digest in read_blocks(self._file, self._path, unsound_end=True):
            if self.count < 0:
                self.arm, self.options, _ = _read_head(content, self._path)
            whole = self._file.tell()
            self._before = digest
            self.count = self.count + 1
        if self.count < 0:
            raise DamagedRecordingError(
                f"{self._path} holds no beginning; begin anew (--overwrite)"
            )
        try:
            self._file.truncate(whole)
            self._file.seek(whole)
        except OSError as error:
            raise RecordingError(
                f"{self._path} cannot be written: {error}; choose another place"
            ) from error

    @classmethod
    def create(
        cls, path: str | os.PathLike, arm: ArmSpec, options: Mapping[str, Any]
    ) -> "EpisodeWriter":
        """Begin a new file; what was there is replaced.

        Raises:
            RecordingError: it cannot be written, or somebody writes to the one that is
                there.
        """
        with written_whole(path, RecordingError) as part, open(part, "wb") as file:
            if Path(path).is_file():
                with open(path, "rb") as there:
                    lock(there, path)
            write_block(file, _head(arm, options, None), b"")
        return cls(path)

    def append(self, episode: Episode) -> None:
        """Add an episode; when this returns it is on the disk, and when it raises it is not in the file.

        Raises:
            RecordingError: it is of another arm, or cannot be written, such as on a
                full disk; all before it is whole.
        """
        if episode.arm != self.arm:
            raise RecordingError(
                f"an episode of '{episode.arm.name}' does not belong into {self._path}"
            )
        end = self._file.tell()
        try:
            before = write_block(self._file, _packed(episode), self._before)
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(end)
                self._file.seek(end)
            raise RecordingError(
                f"{self._path}: an episode could not be written: {error}; {self.count} whole ones are kept: make room, "
                "then go on (--resume)"
            ) from error
        self.count = self.count + 1
        self._before = before

    def close(self) -> None:
        """Close the file; can be called twice."""
        self._file.close()


def _head(arm: ArmSpec, options: Mapping[str, Any], count: int | None) -> bytes:
    """How many episodes follow is said where that is known: a file that was cut short then tells."""
    said = {
        "schema": SCHEMA,
        "version": s2c2a.__version__,
        "arm": arm_to_toml(arm),
        "options": dict(options),
    }
    return _json(said | {"count": count})


def _json(value: Any) -> bytes:
    try:
        return json.dumps(
            value, allow_nan=False, ensure_ascii=False, default=str
        ).encode()
    except (ValueError, TypeError, RecursionError) as error:
        raise RecordingError(
            f"options {value!r:.200} cannot be kept: {error}; take words and finite numbers"
        ) from error


def _packed(episode: Episode) -> bytes:
    arrays = {
        name: np.ascontiguousarray(values) for name, values in episode.columns.items()
    }
    return save(arrays, metadata={"options": _json(dict(episode.options)).decode()})


def _read_head(
    content: bytes, path: str | os.PathLike
) -> tuple[ArmSpec, dict[str, Any], int | None]:
    """Arm, options, and how many episodes follow if that is known."""
    try:
        said = from_json(content)
        if said["schema"] != SCHEMA:
            raise damaged(
                path, f"of schema {said['schema']}, this version reads {SCHEMA}"
            )
        return (
            arm_from_toml(str(said["arm"]), f"arm in {path}"),
            dict(said["options"]),
            said["count"],
        )
    except DamagedRecordingError:
        raise
    except (ValueError, KeyError, TypeError, RecursionError, S2C2AError) as error:
        raise damaged(path, str(error)) from error


def _unpacked(content: bytes, arm: ArmSpec, path: str | os.PathLike) -> Episode:
    try:
        header = content[LENGTH : LENGTH + int.from_bytes(content[:LENGTH], "little")]
        options = from_json(from_json(header)["__metadata__"]["options"])
        return Episode(arm, load(content), dict(options))
    except (
        SafetensorError,
        ValueError,
        KeyError,
        TypeError,
        RecursionError,
        S2C2AError,
    ) as error:
        raise damaged(path, str(error)) from error
