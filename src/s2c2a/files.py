"""Files written whole or not at all, and text of others read with care."""

import os
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from s2c2a.errors import S2C2AError

MAX_TEXT = 1_000_000
"""Bytes of a file of text, where nothing else is said."""
# in a line of TOML: what a dotted key costs grows with the square of its parts
MAX_DOTS = 1000


def read_text(
    path: str | os.PathLike, fault: type[S2C2AError] = S2C2AError, most: int = MAX_TEXT
) -> str:
    """The text of a file; of an endless one no more is read than allowed.

    Args:
        path: the file.
        fault: what to raise.
        most: bytes that it may have.

    Raises:
        S2C2AError: it cannot be read, is too large, or not UTF-8.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise fault(f"{path} has more than {most} bytes; take a smaller file")
        return content.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise fault(
            f"{path}: cannot be read as UTF-8 text: {error}; check the path, and that it is text"
        ) from error


def holds(path: str | os.PathLike, text: str) -> bool:
    """Whether a file is just this text; no more of it is read than that is long."""
    with suppress(OSError), open(path, "rb") as file:
        return file.read(len(text.encode()) + 1) == text.encode()
    return False


def toml_in(text: str, fault: type[S2C2AError] = S2C2AError) -> dict[str, Any]:
    """The table that TOML says.

    Raises:
        S2C2AError: it is none.
    """
    try:
        if any(line.count(".") > MAX_DOTS for line in text.splitlines()):
            raise ValueError(f"a line with more than {MAX_DOTS} dots")
        # such numbers cannot even be shown in an error
        if re.search(r"0[xob]\w{400}", text):
            raise ValueError("a whole number of hundreds of digits")
        return tomllib.loads(text)
    # its own error, or a whole number of thousands of digits
    except (ValueError, RecursionError) as error:
        raise fault(f"not valid TOML: {error}") from error


@contextmanager
def written_whole(
    path: str | os.PathLike, fault: type[S2C2AError] = S2C2AError
) -> Iterator[Path]:
    """Where to write a file, beside its place; it is moved there in the end, or goes if that fails.

    Missing folders are made; a file of that name is replaced. A process that is killed
    leaves at most its part, hidden.

    Args:
        path: the file.
        fault: what to raise.

    Raises:
        S2C2AError: the file cannot be written.
    """
    path = Path(path)
    part = path.parent / f".{path.name}.{os.getpid()}.part"
    try:
        if not path.name:
            raise IsADirectoryError(f"{path} is a folder")
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        os.replace(part, path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise fault(
                f"cannot write {path}: {error}; choose a place where you may write"
            ) from error
        raise


def save_whole(
    content: bytes | str, path: str | os.PathLike, fault: type[S2C2AError] = S2C2AError
) -> Path:
    """Write a file as `written_whole` does; text in UTF-8.

    Raises:
        S2C2AError: the file cannot be written.
    """
    with written_whole(path, fault) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)
