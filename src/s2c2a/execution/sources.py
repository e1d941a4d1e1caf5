"""Sources that values depend on, and their digest.

Files that the project keeps are found by the `repr` of everything that they depend on.
That text stays the same when code is edited, so the key of a kept file also holds the
digest of the sources that make it: those of all classes among the values, of texts such
as `my_strategy.py:Mine`, and of what these import in turn.
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
from threading import Lock
from typing import Any, NamedTuple

from pydantic import BaseModel

from s2c2a.execution.versions import PACKAGE, PACKAGES
from s2c2a.plugins.discovery import GROUPS, located

KNOWN = sys.stdlib_module_names.union(PACKAGES)
"""Packages that are known by their versions, or by that of Python."""
INSTALLED = {"site-packages", "dist-packages"}
"""Folders whose modules belong to many packages."""
PARSING = Lock()  # in several threads at once, Python 3.11 fails
FOR_TYPES = "TYPE_CHECKING", "typing.TYPE_CHECKING"
BLOCKS = ast.Module, ast.stmt, ast.excepthandler, ast.match_case
"""What statements stand in."""


def code_digest(*values: Any) -> str:
    """Digest of the source files that values reach; empty if they reach none.

    It counts the files of classes, and of texts such as `file.py:Name`,
    `module:Name` and names of entry points; and the files that these import from this
    package, or from their own folder or package. Nothing is imported.

    Args:
        values: any; dataclasses, pydantic models and containers are searched.
    """
    digests: set[str] = set()
    for file in {file for value in values for file in _named_files(value)}:
        digests |= _digests(file)
    joined = "".join(sorted(digests))
    return blake2b(joined.encode()).hexdigest()[:16] if joined else ""


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
    if is_dataclass(value) or isinstance(value, BaseModel):
        return list(vars(value).values())
    return list(value) if isinstance(value, list | tuple | set | frozenset) else []


def _files_in_text(text: str) -> Iterator[Path]:
    """Files of `file.py:Name`, `module:Name` (options may follow) or an entry point."""
    # a comma may begin options, or be part of a path
    for name in (text, text.partition(",")[0]):
        place, _, attribute = name.rpartition(":")
        if name in _entry_point_modules():
            yield from _module_files(_entry_point_modules()[name])
        if not attribute.isidentifier():
            continue
        if place.endswith(".py"):
            file = located(name, place)
            if _is_file(file):  # a link has neighbors of its own
                yield file.absolute()
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
    if top in KNOWN:
        return
    loaded = getattr(sys.modules.get(module), "__file__", None)
    if loaded:
        if _is_file(Path(loaded)):
            yield Path(loaded).resolve()
        return
    for folder in (Path.cwd(), *map(Path, sys.path)):
        if found := _file_in(folder, module):
            yield found.resolve()
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
            return candidate
    return None


class _Import(NamedTuple):
    """One name that a source imports.

    Attributes:
        level: number of dots before the module.
        module: whose name is imported, or that is imported itself.
        name: of `from module import name`; "" for the module itself.
        bound: the name that it has then.
    """

    level: int
    module: str
    name: str
    bound: str


def _digests(file: Path) -> set[str]:
    """Digests of a file and of all that it imports, directly or not."""
    digests = set()
    seen = {file}
    waiting = [file]
    while waiting:
        file = waiting.pop()
        read = _kept if file.is_relative_to(PACKAGE) else _read
        digest, imported = read(file)
        digests.add(digest)
        waiting += imported - seen
        seen |= imported
    return digests


def _read(file: Path) -> tuple[str, set[Path]]:
    """Digest of a file, and the files that it imports."""
    source = file.read_bytes()
    found = (_files_of(file, each) for each in _imports(source))
    return blake2b(source).hexdigest(), set[Path]().union(*found)


_kept = cache(_read)
"""The same of a file of this package, whose code stays as it was imported."""


def _files_of(file: Path, wanted: _Import) -> set[Path]:
    """Files that an import of a file runs: the module, and the packages that it is in."""
    for folder in _folders(file, wanted):
        names = wanted.module.split(".")
        module = _file_in(folder, wanted.module)
        inner = _file_in(folder, f"{wanted.module}.{wanted.name}".strip("."))
        outer = (".".join(names[:end]) for end in range(1, len(names)))
        around = (_file_in(folder, name) for name in outer)
        files = {each for each in (module, inner, *around) if each is not None}
        if files:
            return files | _imported_when_asked(file, inner, module, wanted.name)
    return set()


def _imported_when_asked(
    file: Path, inner: Path | None, module: Path | None, name: str
) -> set[Path]:
    """What a package imports not before it is asked for: its stub tells."""
    asked = inner or module
    stub = asked and asked.with_suffix(".pyi")
    if stub is None or not stub.is_file():
        return set()
    if inner is None:
        named = (each for each in _imports(stub.read_bytes()) if each.bound == name)
        return set().union(*(_files_of(stub, each) for each in named))
    # inside a package, it is imported for its version
    return set() if stub.parent in file.parents else {stub}


def _folders(file: Path, wanted: _Import) -> list[Path]:
    """Folders in which an import may find its module: none of installed packages."""
    if wanted.level:  # Python refuses more dots than folders
        return list(file.parents[wanted.level - 1 : wanted.level])
    outermost = _outermost(file.parent)
    top = wanted.module.partition(".")[0]
    if top == file.relative_to(outermost).parts[0]:
        return [outermost]
    if top == PACKAGE.name:
        return [PACKAGE.parent]
    if top in KNOWN:
        return []
    places = (outermost, *map(Path, sys.path))
    return [place for place in places if INSTALLED.isdisjoint(place.parts)]


@cache
def _outermost(folder: Path) -> Path:
    """Folder of the package that a folder belongs to, or itself."""
    is_package = (folder / "__init__.py").is_file()
    return _outermost(folder.parent) if is_package else folder


@cache
def _imports(source: bytes) -> tuple[_Import, ...]:
    """All that a source may import when it runs."""
    try:
        with PARSING:
            waiting: list[ast.AST] = [ast.parse(source)]
    # reported where it is imported; the last two: too many nested expressions
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ()
    found = []
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found += [_Import(0, alias.name, "", "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                bound = alias.asname or alias.name
                module = node.module or ""
                found.append(_Import(node.level, module, alias.name, bound))
        elif isinstance(node, ast.If) and ast.unparse(node.test) in FOR_TYPES:
            waiting += node.orelse
        elif isinstance(node, BLOCKS):
            waiting += ast.iter_child_nodes(node)
    return tuple(found)
