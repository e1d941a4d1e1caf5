"""Things found by name: those of the package, those of other packages, and those in a file of the user's.

Sensors, forward models, robots, tasks, terms and solvers are all asked for in this way,
so that adding one needs no change here (docs/extending.md).
"""

import importlib
import sys
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from s2c2a.errors import S2C2AError


def found(kind: str, name: str, known: Mapping[str, Any]) -> Any:
    """What a name stands for: one of those known, an entry point of `s2c2a.<kind>s`, `module:Name` or `file.py:Name`.

    A file's folder, or for a module the folder where the command was given, becomes a
    place to import from: processes that are started later find it there too.

    Args:
        kind: what is looked for, such as "robot".
        name: what a user typed.
        known: those of the package, by name.

    Raises:
        S2C2AError: nothing of that name, or its module cannot be imported.
    """
    if name in known:
        return known[name]
    where, colon, what = name.rpartition(":")
    point = (
        None
        if colon
        else next(iter(entry_points(group=f"s2c2a.{kind}s", name=name)), None)
    )
    if not colon and point is None:
        raise S2C2AError(
            f"no {kind} '{name}'; choose one of {', '.join(known) or 'none'}, or give your own as module:Name or "
            "file.py:Name"
        )
    try:
        return point.load() if point else getattr(_module(where), what)
    except Exception as error:  # whatever code of others raises while it is imported
        raise S2C2AError(
            f"the {kind} '{name}' cannot be loaded: {type(error).__name__}: {error}"
        ) from error


def _module(where: str):
    """A module by its name, or by its file."""
    path = Path(where)
    folder = str(path.resolve().parent) if path.suffix == ".py" else str(Path.cwd())
    if path.suffix == ".py" and not path.is_file():
        raise ImportError(f"there is no file {where}")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    module = importlib.import_module(path.stem if path.suffix == ".py" else where)
    if path.suffix == ".py" and Path(str(module.__file__)).resolve() != path.resolve():
        raise ImportError(
            f"another module named {path.stem} was found first, at {module.__file__}; rename the file"
        )
    return module
