"""Folders that appear whole or not at all, and maps of what is written."""

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import tomli_w

from s2c2a.errors import S2C2AError
from s2c2a.files.text import cannot_write, parse_toml, write_atomically


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder, which becomes `path` on success.

    Raises:
        S2C2AError: `path` exists, or cannot be written.
    """
    if os.path.lexists(path):
        raise S2C2AError(
            f"{path} exists, and a folder is not replaced; choose another --out, or "
            "delete it first"
        )
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.mkdir(parents=True)
        yield part
        part.rename(path)
    except OSError as error:
        raise S2C2AError(cannot_write(path, part, error)) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def write_map(text: str, names: Mapping[str, str], path: Path, **rows: str) -> None:
    """Write a map of `export_table.import_map` for columns with other names.

    Args:
        text: of the map; empty if no module end was measured, and nothing is written.
        names: those of the written columns, by their names in the table.
        path: of the map.
        rows: further keys of its table `rows`.
    """
    if not text:
        return
    content = _renamed(parse_toml(text), names)
    content["rows"] |= rows
    write_atomically(tomli_w.dumps(content), path)


def _renamed(value: Any, names: Mapping[str, str]) -> Any:
    if isinstance(value, dict):
        return {key: _renamed(entry, names) for key, entry in value.items()}
    if isinstance(value, list):
        return [_renamed(entry, names) for entry in value]
    return names.get(value, value) if isinstance(value, str) else value
