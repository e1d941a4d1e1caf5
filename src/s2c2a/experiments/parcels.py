"""Files as they travel between machines: their names and contents."""

from collections.abc import Iterable
from pathlib import Path

from s2c2a.files import save_whole

Parcel = dict[str, bytes]
"""Name -> content."""


def packed(paths: Iterable[Path]) -> Parcel:
    """Read files."""
    return {path.name: path.read_bytes() for path in paths}


def unpack(parcel: Parcel, folder: Path) -> Path:
    """Write files into a folder, which it returns; each appears whole or not at all, and replaces what was there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in parcel.items():
        save_whole(content, folder / Path(name).name)
    return folder
