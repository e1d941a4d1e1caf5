"""Atomic file writes, and guarded reading of text files from other people."""

import os
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from s2c2a.errors import S2C2AError

MAX_TEXT = 1_000_000
"""Default maximum size of a text file [bytes]."""
MAX_DOTS = (
    1000  # per line of TOML: parsing time grows with the square of the key's parts
)


def read_text(
    path: str | os.PathLike, fault: type[S2C2AError] = S2C2AError, most: int = MAX_TEXT
) -> str:
    """Return the text of a UTF-8 file; reading stops at the maximum size.

    Args:
        path: the file.
        fault: class of the exception.
        most: maximum size [bytes].

    Raises:
        S2C2AError: the file cannot be read, is too large or is not UTF-8.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise fault(f"{path} has more than {most} bytes; take a smaller file")
        return content.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise fault(
            f"{path}: cannot be read as UTF-8 text: {error}; check the path, and that "
            "it is text"
        ) from error


def holds(path: str | os.PathLike, text: str) -> bool:
    """Whether the content of a file equals a text; reads no more than its length."""
    expected = text.encode()
    with suppress(OSError), open(path, "rb") as file:
        return file.read(len(expected) + 1) == expected
    return False


def parse_toml(text: str, fault: type[S2C2AError] = S2C2AError) -> dict[str, Any]:
    """Parse TOML.

    Raises:
        S2C2AError: the text is not valid TOML.
    """
    try:
        if any(line.count(".") > MAX_DOTS for line in text.splitlines()):
            raise ValueError(f"a line with more than {MAX_DOTS} dots")
        # Python cannot print such numbers, not even in an error message
        if re.search(r"0[xob]\w{400}", text):
            raise ValueError("an integer of hundreds of digits")
        return tomllib.loads(text)
    # ValueError: invalid TOML, or an integer of thousands of digits
    except (ValueError, RecursionError) as error:
        raise fault(f"not valid TOML: {error}") from error


@contextmanager
def atomic_write(
    path: str | os.PathLike, fault: type[S2C2AError] = S2C2AError
) -> Iterator[Path]:
    """Yield a temporary path; on success it replaces `path`, on failure it is deleted.

    Missing folders are created. A killed process leaves at most a hidden temporary
    file.

    Args:
        path: the file.
        fault: class of the exception.

    Raises:
        S2C2AError: the file cannot be written.
    """
    path = Path(path)
    temporary = path.parent / f".{path.name}.{os.getpid()}.part"
    try:
        if not path.name:
            raise IsADirectoryError(f"{path} is a folder")
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise fault(
                f"cannot write {path}: {error}; choose a place where you may write"
            ) from error
        raise


def write_atomically(
    content: bytes | str, path: str | os.PathLike, fault: type[S2C2AError] = S2C2AError
) -> Path:
    """Write a file atomically, text as UTF-8.

    Raises:
        S2C2AError: the file cannot be written.
    """
    if isinstance(content, str):
        content = content.encode()
    with atomic_write(path, fault) as temporary:
        temporary.write_bytes(content)
    return Path(path)
