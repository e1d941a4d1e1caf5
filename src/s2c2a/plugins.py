"""Plugins: components found by name in the package, in other packages or in user files.

Sensors, forward models, robots, tasks, cost terms and solvers are all found this way,
so that a new one needs no change in the package (docs/guides/extending.md).
"""

import importlib
import sys
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from s2c2a.errors import S2C2AError, did_you_mean


def resolve(kind: str, name: str, known: Mapping[str, Any]) -> Any:
    """Return the object that a name refers to.

    The name is one of `known`, an entry point of the group `s2c2a.<kind>s`,
    `module:Name` or `file.py:Name`. The folder of the file (for a module, the current
    folder) is added to `sys.path`, so that processes started later find it too.

    Args:
        kind: type of the object, such as "robot".
        name: as the user typed it.
        known: objects of the package, by name.

    Raises:
        S2C2AError: the name is unknown, or the module cannot be imported.
    """
    if name in known:
        return known[name]
    module, colon, attribute = name.rpartition(":")
    try:
        if colon:
            return getattr(_import_module(module), attribute)
        for entry_point in entry_points(group=f"s2c2a.{kind}s", name=name):
            return entry_point.load()
    except Exception as error:  # custom code may raise anything during its import
        raise S2C2AError(
            f"the {kind} '{name}' cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    raise S2C2AError(
        f"no {kind} '{name}'{did_you_mean(name, known)}; "
        f"choose one of {', '.join(known) or 'none'}, or give your own as "
        "module:Name or file.py:Name"
    )


def _import_module(name: str):
    """Import a module by its name or by its file."""
    path = Path(name)
    if path.suffix != ".py":
        _add_to_path(str(Path.cwd()))
        return importlib.import_module(name)
    if not path.is_file():
        raise ImportError(f"there is no file {name}")
    _add_to_path(str(path.resolve().parent))
    module = importlib.import_module(path.stem)
    if Path(str(module.__file__)).resolve() != path.resolve():
        raise ImportError(
            f"another module named {path.stem} was found first, at {module.__file__}; "
            "rename the file"
        )
    return module


def _add_to_path(folder: str) -> None:
    if folder not in sys.path:
        sys.path.insert(0, folder)
