"""Files as rows of checked blocks: safe to open, whoever made them.

A block is the word `S2C2A` and a line feed, the length of its content (8 bytes,
little-endian), a digest of the length (8 bytes), the content, a digest of both (16
bytes). Digests are BLAKE2b with the digest of the block before as key: a block that was
moved, doubled or taken out is as wrong as one that was changed. Nobody looks inside a
block before its digest is right, and sizes are capped before anything is read.

Blocks are only ever added at the end, so a process that is killed leaves whole ones and
at most a part of the last. Since a length has a digest of its own, such a part cannot
be mistaken for a block whose length is damaged.
"""

import errno
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from s2c2a.errors import DamagedRecordingError, RecordingError

WORD = b"S2C2A\n"
# bytes
LENGTH = 8
CHECK = 8
DIGEST = 16
START = len(WORD) + LENGTH + CHECK
MAX_BYTES = 500_000_000
MAX_BLOCK = 150_000_000
MAX_HEAD = 1_000_000


def write_block(file: Any, content: bytes, before: bytes) -> bytes:
    """Add a block at the end of a file; its digest, which the next one needs.

    Raises:
        OSError: it, or the file, becomes larger than may be read again.
    """
    if (
        len(content) > MAX_BLOCK
        or file.tell() + START + len(content) + DIGEST > MAX_BYTES
    ):
        raise OSError(
            errno.EFBIG,
            f"at most {MAX_BLOCK} bytes an episode and {MAX_BYTES} a file; take several files",
        )
    length = len(content).to_bytes(LENGTH, "little")
    digest = _digest(DIGEST, before, length, content)
    left = memoryview(WORD + length + _digest(CHECK, before, length) + content + digest)
    while left:  # an unbuffered file may take a part of it
        left = left[file.write(left) :]
    return digest


def read_blocks(
    file: BinaryIO, path: str | os.PathLike, unsound_end: bool = False
) -> Iterator[tuple[bytes, bytes]]:
    """Contents of all blocks and their digests, each once it is right; a part of one at the end is passed over.

    Args:
        file: at its beginning.
        path: for errors.
        unsound_end: whether the last one's digest may be wrong, as when power fails; it
            is passed over.

    Raises:
        DamagedRecordingError: a byte is not as it was written.
    """
    size = os.fstat(file.fileno()).st_size
    before = b""
    while (begin := file.tell()) < size:
        start = file.read(START)
        length = start[len(WORD) : len(WORD) + LENGTH]
        count = int.from_bytes(length, "little")
        if not start.startswith(WORD[: len(start)]) or (
            len(start) == START
            and start != WORD + length + _digest(CHECK, before, length)
        ):
            raise damaged(path, "its blocks do not follow each other")
        if len(start) < START or count > size - file.tell() - DIGEST:
            if begin:
                return
            raise damaged(path, "it is cut off")
        if count > (MAX_BLOCK if begin else MAX_HEAD):
            raise damaged(path, f"a block of {count} bytes")
        content = file.read(count)
        before = _digest(DIGEST, before, length, content)
        if file.read(DIGEST) != before:
            if unsound_end and begin and file.tell() == size:
                return
            raise damaged(path, "a checksum is wrong")
        yield content, before


def opened_blocks(
    path: str | os.PathLike, mode: str = "rb", buffering: int = -1
) -> Any:
    """A file of blocks, at its beginning.

    Raises:
        RecordingError: none there, or it cannot be opened.
        DamagedRecordingError: too large, or no file of blocks.
    """
    if not Path(path).is_file():
        raise RecordingError(
            f"no recording at {path}; make one with `s2c2a collect` or `s2c2a import`"
        )
    try:
        file = open(path, mode, buffering)
        begin = file.read(8)
        size = os.fstat(file.fileno()).st_size
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be opened: {error}; check its permissions"
        ) from error
    if begin.startswith(WORD) and size <= MAX_BYTES:
        file.seek(0)
        return file
    file.close()
    if begin == b"\x89HDF\r\n\x1a\n":
        raise DamagedRecordingError(
            f"{path} was written by version 0.1; collect it again with `s2c2a collect`, the numbers are the same"
        )
    if size > MAX_BYTES:
        raise DamagedRecordingError(
            f"{path} has {size} bytes; files of episodes have at most {MAX_BYTES}"
        )
    raise DamagedRecordingError(
        f"{path} is no file of episodes, or its beginning is damaged; collect, run or import it anew"
    )


def lock(file: BinaryIO, path: str | os.PathLike) -> None:
    """One writer at a time, where the system knows locks.

    Raises:
        RecordingError: there is one.
    """
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise RecordingError(
            f"{path} is in use by another process; wait for it, or take another name"
        ) from error


def damaged(path: str | os.PathLike, why: str) -> DamagedRecordingError:
    """The error that says so."""
    return DamagedRecordingError(
        f"{path} is damaged, or no file of episodes: {why}; collect, run or import it anew"
    )


def _digest(size: int, before: bytes, *parts: bytes) -> bytes:
    digest = hashlib.blake2b(digest_size=size, key=before)
    for part in parts:
        digest.update(part)
    return digest.digest()
