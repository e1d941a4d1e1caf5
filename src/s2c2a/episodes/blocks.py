"""Block files with checksums: safe to open, whatever their source.

A block is the magic word `S2C2A` and a line feed, the length of its content (8 bytes,
little-endian), a digest of the length (8 bytes), the content, a digest of length and
content (16 bytes). Digests are BLAKE2b with the digest of the previous block as key, so
a block that was moved, duplicated or removed is as invalid as one that was changed. A
reader parses a block only after its digest is valid, and checks sizes before it reads.

Files only grow at the end: a process that is killed leaves whole blocks and at most a
part of the last one. Since the length has its own digest, a partial block cannot be
confused with a block whose length is damaged.
"""

import errno
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from s2c2a.errors import DamagedRecordingError, RecordingError
from s2c2a.files.text import MAX_BYTES, MAX_TEXT

WORD = b"S2C2A\n"
# bytes; the format, as above
LENGTH = 8
CHECK = 8
DIGEST = 16
START = len(WORD) + LENGTH + CHECK


def write_block(file: Any, content: bytes, previous_digest: bytes) -> bytes:
    """Append a block to a file.

    Args:
        file: open for writing, at its end.
        content: of the block.
        previous_digest: digest of the previous block; empty for the first one.

    Returns:
        The digest of the block, which the next one needs.

    Raises:
        OSError: the block or the file would exceed the size that can be read.
    """
    new_size = file.tell() + START + len(content) + DIGEST
    if new_size > MAX_BYTES:
        raise OSError(
            errno.EFBIG, f"at most {MAX_BYTES} bytes a file; use several files"
        )
    length = len(content).to_bytes(LENGTH, "little")
    start = WORD + length + _digest(CHECK, previous_digest, length)
    digest = _digest(DIGEST, previous_digest, length, content)
    remaining = memoryview(start + content + digest)
    while remaining:  # an unbuffered file may write only a part
        remaining = remaining[file.write(remaining) :]
    return digest


def read_blocks(
    file: BinaryIO, path: str | os.PathLike, allow_damaged_end: bool = False
) -> Iterator[tuple[bytes, bytes]]:
    """Yield the contents of all blocks and their digests, each after verification.

    A partial block at the end is skipped.

    Args:
        file: at its beginning.
        path: for error messages.
        allow_damaged_end: whether to skip a last block with a wrong digest, as after a
            power failure.

    Raises:
        DamagedRecordingError: a byte differs from what was written.
    """
    size = os.fstat(file.fileno()).st_size
    digest = b""
    while (begin := file.tell()) < size:
        start = file.read(START)
        length = start[len(WORD) : len(WORD) + LENGTH]
        is_partial = len(start) < START
        if is_partial:
            valid = start.startswith(WORD[: len(start)])
        else:
            valid = start == WORD + length + _digest(CHECK, digest, length)
        if not valid:
            raise damaged(path, "its blocks do not follow each other")
        count = int.from_bytes(length, "little")
        if is_partial or count > size - file.tell() - DIGEST:
            if begin:
                return
            raise damaged(path, "it is truncated")
        if not begin and count > MAX_TEXT:
            raise damaged(path, f"a block of {count} bytes")
        content = file.read(count)
        digest = _digest(DIGEST, digest, length, content)
        if file.read(DIGEST) != digest:
            if allow_damaged_end and begin and file.tell() == size:
                return
            raise damaged(path, "a checksum is wrong")
        yield content, digest


def open_blocks(path: str | os.PathLike, mode: str = "rb", buffering: int = -1) -> Any:
    """Open a block file at its beginning.

    Raises:
        RecordingError: there is no such file, or it cannot be opened.
        DamagedRecordingError: it is too large, or not a block file.
    """
    if files := sorted(Path(path).glob("*.episodes")):
        raise RecordingError(
            f"{path} is a folder; give a file in it, such as {files[0]}"
        )
    if not Path(path).is_file():
        raise RecordingError(
            f"no recording at {path}; make one with `s2c2a collect` or `s2c2a import`"
        )
    try:
        file = open(path, mode, buffering)  # noqa: SIM115  # closed by the caller
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
    if size > MAX_BYTES:
        raise DamagedRecordingError(
            f"{path} has {size} bytes; files of episodes have at most {MAX_BYTES}"
        )
    raise DamagedRecordingError(
        f"{path} is no file of episodes, such as `s2c2a collect`, `run` or `import` "
        "writes, or its beginning is damaged; give another, or make it again"
    )


def lock(file: BinaryIO, path: str | os.PathLike) -> None:
    """Lock a file for one writer, on systems with file locks.

    Raises:
        RecordingError: another process has the lock.
    """
    try:
        import fcntl  # noqa: PLC0415  # not on Windows
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise RecordingError(
            f"{path} is in use by another process; wait for it, or use another name"
        ) from error


def damaged(path: str | os.PathLike, reason: str) -> DamagedRecordingError:
    """Return the error for a damaged file."""
    return DamagedRecordingError(
        f"{path} is damaged, or no file of episodes: {reason}; "
        "collect, run or import it again"
    )


def _digest(size: int, key: bytes, *parts: bytes) -> bytes:
    digest = hashlib.blake2b(digest_size=size, key=key)
    for part in parts:
        digest.update(part)
    return digest.digest()
