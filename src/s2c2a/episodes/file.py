"""Files of episodes (`.episodes`): written atomically, verified before use.

The first block (`blocks`) is JSON: schema, version, arm (TOML), options, and the number
of episodes if it is known. Every other block is an episode in the safetensors format,
with its options as JSON in the metadata. Reading creates only arrays of numbers.
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
    open_blocks,
    read_blocks,
    write_block,
)
from s2c2a.episodes.episode import Episode
from s2c2a.errors import DamagedRecordingError, RecordingError, S2C2AError
from s2c2a.files.text import atomic_write

ENDING = ".episodes"
SCHEMA = 2  # of the format; another number is another format
# bytes; safetensors headers of all episodes together, which expand when parsed
MAX_HEADERS = 10_000_000


def save_episodes(
    episodes: Iterable[Episode],
    path: str | os.PathLike,
    options: Mapping[str, Any] | None = None,
) -> Path:
    """Write episodes of one arm; the file appears complete or not at all.

    Raises:
        RecordingError: there is no episode, episodes are of different arms, or the file
            cannot be written.
    """
    episodes = list(episodes)
    if not episodes or any(episode.arm != episodes[0].arm for episode in episodes):
        raise RecordingError(
            "a file of episodes holds at least one, all of the same arm"
        )
    header = _pack_header(episodes[0].arm, options or {}, len(episodes))
    with atomic_write(path, RecordingError) as part, open(part, "wb") as file:
        digest = write_block(file, header, b"")
        for episode in episodes:
            digest = write_block(file, _pack(episode), digest)
        file.flush()
        os.fsync(file.fileno())
    return Path(path)


def load_episodes(path: str | os.PathLike) -> tuple[list[Episode], dict[str, Any]]:
    """Read all episodes of a file and the options of the file.

    Raises:
        RecordingError: there is no such file, or it holds no whole episode yet.
        DamagedRecordingError: it is not a file of episodes, is truncated, or a byte
            differs from what was written.
    """
    with open_blocks(path) as file:
        blocks = read_blocks(file, path)
        arm, options, count = _unpack_header(next(blocks, (b"", b""))[0], path)
        episodes = []
        header_bytes = 0
        for content, _ in blocks:
            header_bytes += _header_length(content)
            if header_bytes > MAX_HEADERS:
                raise damaged(
                    path, f"the headers of its episodes exceed {MAX_HEADERS} bytes"
                )
            episodes.append(_unpack(content, arm, path))
    if count is not None and len(episodes) != count:
        raise damaged(path, f"{len(episodes)} of {count} episodes are there")
    if not episodes:
        raise RecordingError(
            f"{path} holds no whole episode yet; continue it (--resume) or start again "
            "(--overwrite)"
        )
    return episodes, options


class EpisodeWriter:
    """Open file that grows by whole episodes.

    Attributes:
        arm: arm of the episodes.
        options: options of the file.
        count: number of whole episodes in it.
    """

    def __init__(self, path: str | os.PathLike):
        """Open a file to append to it.

        A partial episode at its end, as a killed process leaves it, is removed.

        Raises:
            RecordingError: there is no such file, it is a link, or it cannot be
                written.
            DamagedRecordingError: it is damaged before its end.
        """
        self._path = Path(path)
        if self._path.is_symlink():
            raise RecordingError(
                f"{path} is a link, and nothing is written through links; "
                "name the file itself"
            )
        self._file = open_blocks(path, "r+b", buffering=0)
        try:
            lock(self._file, path)
            # truncate the file behind its last whole episode
            self.count = -1  # the first block is the header
            end = 0
            for content, digest in read_blocks(
                self._file, self._path, allow_damaged_end=True
            ):
                if self.count < 0:
                    self.arm, self.options, _ = _unpack_header(content, self._path)
                end = self._file.tell()
                self._last_digest = digest
                self.count = self.count + 1
            if self.count < 0:
                raise DamagedRecordingError(
                    f"{self._path} has no header; start again (--overwrite)"
                )
            try:
                self._file.truncate(end)
                self._file.seek(end)
            except OSError as error:
                raise RecordingError(
                    f"{self._path} cannot be written: {error}; choose another place"
                ) from error
        except BaseException:
            self._file.close()
            raise

    @classmethod
    def create(
        cls, path: str | os.PathLike, arm: ArmSpec, options: Mapping[str, Any]
    ) -> "EpisodeWriter":
        """Create a new file in place of an existing one.

        Raises:
            RecordingError: it cannot be written, or another process writes to the
                existing file.
        """
        with atomic_write(path, RecordingError) as part, open(part, "wb") as file:
            if Path(path).is_file():
                with open(path, "rb") as existing:
                    lock(existing, path)
            write_block(file, _pack_header(arm, options, None), b"")
        return cls(path)

    def append(self, episode: Episode) -> None:
        """Append an episode and write it to the disk.

        If this raises, the file does not contain the episode.

        Raises:
            RecordingError: the episode is of another arm, or cannot be written, for
                example on a full disk; earlier episodes are intact.
        """
        if episode.arm != self.arm:
            raise RecordingError(
                f"an episode of '{episode.arm.name}' does not belong in {self._path}; "
                f"that file is of '{self.arm.name}'"
            )
        end = self._file.tell()
        try:
            digest = write_block(self._file, _pack(episode), self._last_digest)
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(end)
                self._file.seek(end)
            raise RecordingError(
                f"{self._path}: an episode could not be written: {error}; "
                f"{self.count} whole ones are kept: make room, then continue (--resume)"
            ) from error
        self.count = self.count + 1
        self._last_digest = digest

    def close(self) -> None:
        """Close the file; allowed more than once."""
        self._file.close()


def _pack_header(arm: ArmSpec, options: Mapping[str, Any], count: int | None) -> bytes:
    """Pack the header; with the number of episodes, truncation can be detected."""
    header = {
        "schema": SCHEMA,
        "version": s2c2a.__version__,
        "arm": arm_to_toml(arm),
        "options": dict(options),
        "count": count,
    }
    return _to_json(header)


def _to_json(value: Any) -> bytes:
    try:
        text = json.dumps(value, allow_nan=False, ensure_ascii=False, default=str)
        return text.encode()
    except (ValueError, TypeError, RecursionError) as error:
        raise RecordingError(
            f"options {value!r:.200} cannot be kept: {error}; "
            "use text and finite numbers"
        ) from error


def _pack(episode: Episode) -> bytes:
    arrays = {
        name: np.ascontiguousarray(values) for name, values in episode.columns.items()
    }
    options = _to_json(dict(episode.options)).decode()
    return save(arrays, metadata={"options": options})


def _unpack_header(
    content: bytes, path: str | os.PathLike
) -> tuple[ArmSpec, dict[str, Any], int | None]:
    """Return arm, options, and the number of episodes if it is known."""
    try:
        header = from_json(content)
        schema = header["schema"]
        if schema != SCHEMA:
            raise damaged(path, f"of schema {schema}, this version reads {SCHEMA}")
        arm = arm_from_toml(str(header["arm"]), f"arm in {path}")
        return arm, dict(header["options"]), header["count"]
    except DamagedRecordingError:
        raise
    except (ValueError, KeyError, TypeError, RecursionError, S2C2AError) as error:
        raise damaged(path, str(error)) from error


def _header_length(content: bytes) -> int:
    """Return the length of the safetensors header of an episode [bytes]."""
    return int.from_bytes(content[:LENGTH], "little")


def _unpack(content: bytes, arm: ArmSpec, path: str | os.PathLike) -> Episode:
    try:
        header = from_json(content[LENGTH : LENGTH + _header_length(content)])
        options = from_json(header["__metadata__"]["options"])
        # safetensors returns them in another order in every process
        return Episode(arm, dict(sorted(load(content).items())), dict(options))
    except (
        SafetensorError,
        ValueError,
        KeyError,
        TypeError,
        RecursionError,
        S2C2AError,
    ) as error:
        raise damaged(path, str(error)) from error
