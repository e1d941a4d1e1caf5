"""Plugins: components found by name in the package, in other packages or in user files.

Sensors, forward models, robots, tasks, cost terms and solvers are all found this way,
so that a new one needs no change in the package (docs/guides/extending.md).

Names of custom code also stand in recordings and weight files, which come from
anywhere. Therefore `resolve`, the only place that imports custom code, imports what is
installed (entry points) or trusted, and nothing else: the names that this command or a
Python call was given, and those in an arm or recipe file given by its path.
"""

import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, TypeVar

from s2c2a.errors import S2C2AError, UntrustedCodeError, did_you_mean
from s2c2a.files.text import restored

Result = TypeVar("Result")

GROUPS = {
    "command": "s2c2a.commands",
    "robot": "s2c2a.robots",
    "robot_wrapper": "s2c2a.robot_wrappers",
    "sensor": "s2c2a.sensors",
    "sensor_model": "s2c2a.sensor_models",
    "estimator": "s2c2a.estimators",
    "model": "s2c2a.models",
    "controller": "s2c2a.controllers",
    "strategy": "s2c2a.strategies",
    "task": "s2c2a.tasks",
    "term": "s2c2a.terms",
    "solver": "s2c2a.solvers",
    "guide": "s2c2a.guides",
    "tracker": "s2c2a.trackers",
    "export": "s2c2a.exports",
    "stream": "s2c2a.streams",
}
"""Groups of entry points, by the kind of objects that they hold."""

_trusted: dict[str, Path | None] = {}
"""Trusted names, each with the folder of the arm file that it stands in, if any."""


def trust_code(*names: str, folder: Path | None = None) -> None:
    """Allow this process, and the workers that it starts, to import custom code.

    Commands call it for the names in their arguments, and in the arm and recipe files
    that they are given. Programs call it for a recording or a weight file that names
    custom code, such as `trust_code("my_sensor.py:MyMap")`.

    Args:
        names: `module:Name` or `file.py:Name`, exactly as the recording or the weight
            file has it. The options of a tracker may follow behind a comma.
        folder: of the arm file that the names stand in: where their files are
            (`located`). Without it, a folder that is known already stays.
    """
    for name in names:
        # a comma may begin options, or be part of a path
        for each in (name, _without_options(name)):
            _trusted[each] = folder or _trusted.get(each)


def trusted_as(name: str) -> str | None:
    """The name by which the user has trusted the code that a file names; None if not.

    Args:
        name: `module:Name`, which a trusted `path/module.py:Name` is, too.
    """
    if name in _trusted:
        return name
    module, _, attribute = name.rpartition(":")
    for each in _trusted:
        file, _, other = each.rpartition(":")
        if Path(file).name == f"{module}.py" and other == attribute:
            return each
    return None


def trust_code_in(table: Any) -> None:
    """Trust all names of code in the nested tables of a file that the user gave."""
    trust_code(*(text for text in _texts(table) if ":" in text))


def located(name: str, file: str) -> Path:
    """Where a file is: beside the arm file that names it, else in the current folder.

    Arms and recordings keep names as they were written.

    Args:
        name: the whole text, such as `my_sensor.py:MyMap`.
        file: within it, such as `my_sensor.py`.
    """
    folder = _trusted.get(name) or _trusted.get(_without_options(name))
    if folder is not None and (folder / file).is_file():
        return folder / file
    return Path(file)


def trust_of_one_command() -> AbstractContextManager[None]:
    """Forget afterwards what is trusted within: the next command names its own code."""
    return restored(_trusted)


def trusted_code() -> tuple[tuple[str, Path | None], ...]:
    """The trusted names and their folders, for a worker's `run_with_trust`."""
    return tuple(sorted(_trusted.items(), key=lambda item: item[0]))


def run_with_trust(
    trusted: tuple[tuple[str, Path | None], ...],
    function: Callable[..., Result],
    *args: Any,
) -> Result:
    """Call a function on a worker that trusts what the parent process trusts."""
    for name, folder in trusted:
        trust_code(name, folder=folder)
    return function(*args)


def resolve(kind: str, name: str, known: Mapping[str, Any]) -> Any:
    """Return the object that a name refers to.

    The name is one of `known`, an entry point of the group of the kind (`GROUPS`),
    `module:Name` or `file.py:Name` (`located`). The folder of the file (for a module,
    the current folder) is added to `sys.path`, so that processes started later find it
    too.

    Args:
        kind: type of the object, such as "robot".
        name: as the user typed it, or as a file has it.
        known: objects of the package, by name.

    Raises:
        UntrustedCodeError: the name is code that the user has not named (`trust_code`).
        S2C2AError: the name is unknown, or the module cannot be imported.
    """
    group = GROUPS[kind]
    if name in known:
        return known[name]
    module, colon, attribute = name.rpartition(":")
    if colon and name not in _trusted:
        raise UntrustedCodeError(
            f"the {kind} '{name}' is code, which a recording or a weight file cannot run; "
            "if you trust it, give the arm file or recipe file that names it (--arm, "
            f"--recipe), or add --trust {name} (in Python: "
            f"s2c2a.plugins.trust_code('{name}'))"
        )
    points = () if colon else tuple(entry_points(group=group, name=name))
    try:
        if colon:
            return getattr(_import_module(module, name), attribute)
        for point in points:
            return point.load()
    except Exception as error:  # custom code may raise anything during its import
        if points and isinstance(error, S2C2AError):  # it names the missing extra
            raise
        raise S2C2AError(
            f"the {kind} '{name}' cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    choices = [*known, *installed(kind)]
    raise S2C2AError(
        f"no {kind} '{name}'{did_you_mean(name, choices)}; "
        f"choose one of {', '.join(choices) or 'none'}, or give your own as "
        "module:Name or file.py:Name"
    )


def installed(kind: str) -> dict[str, EntryPoint]:
    """Entry points of a kind by name: of this package's wings, and of other packages.

    Args:
        kind: one of `GROUPS`.
    """
    return {point.name: point for point in entry_points(group=GROUPS[kind])}


def _without_options(name: str) -> str:
    return name.partition(",")[0]


def _texts(value: Any) -> Iterator[str]:
    """All texts within nested tables and lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for entry in value.values():
            yield from _texts(entry)
    elif isinstance(value, list | tuple):
        for entry in value:
            yield from _texts(entry)


def _import_module(module_or_file: str, name: str):
    """Import a module by its name or by its file."""
    if not module_or_file.endswith(".py"):
        _add_to_path(str(Path.cwd()))
        return importlib.import_module(module_or_file)
    path = located(name, module_or_file)
    if not path.is_file():
        raise ImportError(f"there is no file {path}")
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
