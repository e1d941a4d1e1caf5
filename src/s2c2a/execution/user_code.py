"""Identity of custom code: which source files a value depends on, and their digest.

Files that the project keeps are found by the `repr` of everything that they depend on.
A text such as `my_strategy.py:Mine` stays the same when the file is edited, so the key of
a kept file also holds the digest of all custom code that the values name.
"""

import ast
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import is_dataclass
from functools import cache
from hashlib import blake2b
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from s2c2a.execution.versions import PACKAGES
from s2c2a.plugins.discovery import GROUPS, located

KNOWN = {"s2c2a", *PACKAGES}
"""Packages that are known by their versions."""
INSTALLED = {"site-packages", "dist-packages"}
"""Folders whose modules belong to many packages."""


def code_digest(*values: Any) -> str:
    """Digest of the custom source files that values name; empty if they name none.

    It counts the files of classes outside the package and of texts such as
    `file.py:Name`, `module:Name` and names of entry points; and the files that these
    import from their own folder or package. Nothing is imported.

    Args:
        values: any; dataclasses, pydantic models and containers are searched.
    """
    files: set[Path] = set()
    for value in values:
        for file in _named_files(value):
            _add_with_imports(file, files)
    if not files:
        return ""
    digests = sorted(blake2b(file.read_bytes()).hexdigest() for file in files)
    return blake2b("".join(digests).encode()).hexdigest()[:16]


def _named_files(value: Any) -> Iterator[Path]:
    """Files of custom code that a value names, directly or inside."""
    if isinstance(value, str):
        yield from _files_in_text(value)
        return
    if isinstance(value, type):
        yield from _module_files(value.__module__)
        return
    for part in _parts(value):
        yield from _named_files(part)
    if is_dataclass(value) or isinstance(value, tuple | BaseModel):
        yield from _module_files(type(value).__module__)


def _parts(value: Any) -> list[Any]:
    if isinstance(value, Mapping):
        return [*value.keys(), *value.values()]
    if isinstance(value, list | tuple | set | frozenset):
        return list(value)
    if is_dataclass(value) or isinstance(value, BaseModel):
        return list(vars(value).values())
    return []


def _files_in_text(text: str) -> Iterator[Path]:
    """Files of `file.py:Name`, `module:Name` (options may follow) or an entry point."""
    without_options = text.partition(",")[0]
    # a comma may begin options, or be part of a path
    for name in dict.fromkeys((text, without_options)):
        place, colon, attribute = name.rpartition(":")
        if name in _entry_point_modules():
            yield from _module_files(_entry_point_modules()[name])
        if not colon or not attribute.isidentifier():
            continue
        if place.endswith(".py"):
            file = located(name, place)
            if _is_file(file):
                yield file.resolve()
        elif all(part.isidentifier() for part in place.split(".")):
            yield from _module_files(place)


@cache
def _entry_point_modules() -> dict[str, str]:
    """Modules of all entry points that values can name, by name."""
    points = entry_points()
    return {
        point.name: point.module
        for kind, group in GROUPS.items()
        if kind != "command"
        for point in points.select(group=group)
    }


def _module_files(module: str) -> Iterator[Path]:
    """File of a module that no version tells of."""
    top = module.partition(".")[0]
    if top in KNOWN or top in sys.stdlib_module_names:
        return
    loaded = getattr(sys.modules.get(module), "__file__", None)
    if loaded:
        if _is_file(Path(loaded)):
            yield Path(loaded).resolve()
        return
    for folder in (Path.cwd(), *map(Path, sys.path)):
        if found := _file_in(folder, module):
            yield found
            return


def _is_file(path: Path) -> bool:
    """Whether there is such a file; the path may be any text of a stranger's file."""
    with suppress(OSError, ValueError):  # such as a name that is too long
        return path.is_file()
    return False


def _file_in(folder: Path, module: str) -> Path | None:
    """Source file of a module, if a folder has it."""
    place = folder.joinpath(*module.split("."))
    for candidate in (place.with_name(f"{place.name}.py"), place / "__init__.py"):
        if _is_file(candidate):
            return candidate.resolve()
    return None


def _add_with_imports(file: Path, files: set[Path]) -> None:
    """Add a file, and those that it imports from its own folder or package."""
    if file in files:
        return
    files.add(file)
    try:
        tree = ast.parse(file.read_bytes())
    # reported where it is imported; the last two: too many nested expressions
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    for folder, module in _imports(tree, file):
        if imported := _file_in(folder, module):
            _add_with_imports(imported, files)


def _imports(tree: ast.Module, file: Path) -> Iterator[tuple[Path, str]]:
    """Modules that a file may import, each with the folder to search."""
    # folder of the outermost package of a file; None without a package
    folder = file.parent
    while (folder / "__init__.py").is_file():
        folder = folder.parent
    package = (
        None if folder == file.parent else folder / file.relative_to(folder).parts[0]
    )
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
            level = 0
        elif isinstance(node, ast.ImportFrom):
            start = [node.module] if node.module else []
            # `from package import name`: the name may be a module
            names = [".".join([*start, alias.name]) for alias in node.names]
            names += start
            level = node.level
        else:
            continue
        for name in names:
            if level:
                # Python refuses more dots than folders
                if level <= len(file.parents):
                    yield file.parents[level - 1], name
            elif package is not None and name.partition(".")[0] == package.name:
                yield package.parent, name
            elif file.parent.name not in INSTALLED:
                yield file.parent, name
