"""Atomic file writes, and guarded reading of text files from other people."""

import hashlib
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import Any

from s2c2a.errors import S2C2AError

MAX_TEXT = 1_000_000
"""Largest text file and header [bytes]: a thousand times an arm file, and parsed in
less than a second. A file may be a stranger's."""
MAX_BYTES = 500_000_000
"""Largest binary file [bytes]: more than an hour of any arm, less than the memory."""
MAX_COUNT = 1_000_000
"""Largest count that a file or an option states: a day of control steps at 10 Hz."""
MAX_SEED = 2**31 - 1
"""Largest random seed: a signed 32-bit number, as every generator takes."""
LARGEST = 1e6
"""Largest number from a file, an option or a sensor, in any unit: larger ones are
mistakes, and the squares of these are far from overflow in single precision."""
MAX_DOTS = 1000
"""In a line of TOML: parsing time grows with the square of the key's parts."""


def is_seed(seed: float) -> bool:
    """Whether a number is a random seed of the package."""
    return 0 <= seed <= MAX_SEED and seed % 1 == 0


def open_regular(path: str | os.PathLike) -> BufferedReader:
    """Open a file of strangers; reading from a pipe or a device may never end.

    Raises:
        OSError: it cannot be opened, or is no regular file.
    """
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise OSError(f"{path} is not a regular file")
    return open(path, "rb")


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
        with open_regular(path) as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise fault(f"{path} has more than {most} bytes; take a smaller file")
        return content.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise fault(
            f"{path}: cannot be read as UTF-8 text: {error}; check the path, and that "
            "it is text"
        ) from error


def parse_toml(text: str) -> dict[str, Any]:
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
        raise S2C2AError(f"not valid TOML: {error}") from error


MANIFEST = "manifest.jsonl"
"""List of the files of a folder that this package wrote: name and digest, one a line."""
_PART = re.compile(r"\.(.+)\.\d+\.part")
"""Name of a temporary file of `atomic_write`."""
_kept: set[Path] = set()


def keep_manifest(folder: str | os.PathLike) -> None:
    """List in a manifest all files that this process writes into a folder from now on.

    `manifests_of_one_command` ends it.

    Raises:
        OSError: the manifest is a link: a stranger's folder must not lead elsewhere.
    """
    root = Path(os.path.abspath(folder))
    if (root / MANIFEST).is_symlink():
        raise OSError(f"{MANIFEST} is a link, and nothing is written through links")
    _kept.add(root)


@contextmanager
def restored(kept: set | dict) -> Iterator[None]:
    """Restore a set or a dictionary afterwards."""
    before = kept.copy()
    try:
        yield
    finally:
        kept.clear()
        kept.update(before)


def manifests_of_one_command() -> AbstractContextManager[None]:
    """End the manifests that are begun within."""
    return restored(_kept)


def list_in_manifest(path: Path, content: Path | None = None) -> None:
    """List a file in the open manifest of its folder, if there is one.

    Args:
        path: of the file.
        content: a file with its content; None before it is written, so that a killed
            process leaves no temporary file without its name.
    """
    absolute = Path(os.path.abspath(path))
    for root in _kept:
        if not absolute.is_relative_to(root):
            continue
        name = absolute.relative_to(root).as_posix()
        digest = digest_of(content) if content else ""
        root.mkdir(parents=True, exist_ok=True)
        with open(root / MANIFEST, "a+b") as manifest:
            manifest.seek(max(0, manifest.tell() - 1))
            if manifest.read() not in (b"", b"\n"):  # of a line of a killed process
                manifest.seek(0)
                manifest.truncate(manifest.read().rfind(b"\n") + 1)
            manifest.write(f"{json.dumps([name, digest])}\n".encode())


def digest_of(path: Path) -> str:
    """Digest of the content of a file."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def listed_files(folder: Path) -> frozenset[tuple[str, str]]:
    """Names, relative to the folder, and digests in its manifest.

    A manifest with any other line lists nothing: it may be a stranger's.
    """
    with suppress(S2C2AError, ValueError, TypeError, RecursionError):
        # the last part is blank, or a line of a killed process
        *lines, _ = read_text(folder / MANIFEST, most=MAX_BYTES).split("\n")
        return frozenset(
            (str(name), str(digest)) for name, digest in map(json.loads, lines)
        )
    return frozenset()


def unlisted_files(folder: Path) -> list[str]:
    """Names of all that a folder holds beside the files of its manifest, sorted.

    A file of a listed name with another content is none of them.
    """
    listed = listed_files(folder)
    names = {name for name, _ in listed}
    folders = {parent.as_posix() for name in names for parent in Path(name).parents}
    others = []
    for path in _walk(folder):
        name = path.relative_to(folder).as_posix()
        part = _PART.fullmatch(path.name)
        is_known = False
        if path.is_dir():
            is_known = name in folders
        elif part:
            whole = path.with_name(part[1]).relative_to(folder).as_posix()
            is_known = whole in names
        elif name == MANIFEST:
            is_known = bool(listed)
        elif name in names:
            with suppress(OSError):
                is_known = (name, digest_of(path)) in listed
        if path.is_symlink() or not is_known:
            others.append(name)
    return sorted(others)


def _walk(folder: Path) -> Iterator[Path]:
    """All that a folder holds, folders before their contents; links are not followed."""
    for path in sorted(folder.iterdir()):
        yield path
        if path.is_dir() and not path.is_symlink():
            yield from _walk(path)


def check_replaceable(
    path: str | os.PathLike,
    ending: str,
    fault: type[S2C2AError] = S2C2AError,
    overwrite: bool = True,
) -> None:
    """Refuse to replace a file of another kind, such as a text that a typo names.

    Args:
        path: of the file, which need not exist.
        ending: of the kind that is written, such as ".toml".
        fault: class of the exception.
        overwrite: whether it may be replaced at all.

    Raises:
        S2C2AError: the file exists and has another ending, or is not to be replaced.
    """
    if os.path.exists(path) and not overwrite:
        raise fault(
            f"{path} exists; add --overwrite (in Python overwrite=True), or choose "
            "another name"
        )
    if Path(path).suffix != ending and os.path.lexists(path):
        raise fault(
            f"{path} exists and does not end in {ending}; --overwrite replaces only "
            "files that do: choose another name, or delete that file first"
        )


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
        list_in_manifest(path)
        yield temporary
        if temporary.is_file():
            list_in_manifest(path, temporary)
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise fault(cannot_write(path, temporary, error)) from error
        raise


def cannot_write(path: Path, temporary: Path, error: Exception) -> str:
    """The message on a path that cannot be written; the temporary one is not named."""
    reason = str(error).replace(temporary.name, path.name)
    return f"cannot write {path}: {reason}; choose a place where you may write"


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
