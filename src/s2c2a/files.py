"""Files written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from s2c2a.errors import S2C2AError


@contextmanager
def written_whole(path: str | os.PathLike) -> Iterator[Path]:
    """Where to write a file, beside its place; it is moved there in the end, or goes if that fails.

    Missing folders are made; a file of that name is replaced. A process that is killed leaves at most its part, hidden.

    Raises:
        OSError: the file cannot be written.
    """
    path = Path(path)
    if not path.name:
        raise IsADirectoryError(f"{path} is a folder")
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        os.replace(part, path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def save_whole(content: bytes | str, path: str | os.PathLike) -> Path:
    """Write a file as `written_whole` does; text in UTF-8.

    Raises:
        S2C2AError: the file cannot be written.
    """
    try:
        with written_whole(path) as part:
            part.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise S2C2AError(f"cannot write {path}: {error}; choose a place where you may write") from error
    return Path(path)
