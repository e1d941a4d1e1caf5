"""Options that recipes and commands choose by name, and their registry.

Cost terms, guides, solvers, state estimators, forward models,
controllers and strategies are frozen dataclasses that derive from `Options`. A class
comes with the package, from an entry point of `s2c2a.<kind>s`, or is custom code
(`module:Class` or `file.py:Class`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Generic, TypeVar, cast

from pydantic import ConfigDict, TypeAdapter

from s2c2a.errors import S2C2AError, StrategyError, UntrustedCodeError
from s2c2a.files.text import LARGEST
from s2c2a.plugins.discovery import installed, resolve, trust_code, trusted_as

MAX_VALUES = 100  # of one option, each of which makes programs larger; a file may be a stranger's
Ranges = Mapping[str, tuple[float, float]]
"""Smallest and largest value of options, by name."""
COMPONENT_LIMITS: Ranges = {
    "unit": (1e-6, LARGEST),
    "learning_rate": (1e-9, LARGEST),
    "iterations": (1, 10_000),
}
"""Limits of components by field name; all other numbers are 0 to 1 000 000."""


def check_limits(options: Any, limits: Ranges) -> None:
    """Check the ranges of options.

    Args:
        options: object with an attribute for each limit: a number or a tuple of them.
        limits: of each attribute.

    Raises:
        S2C2AError: a value is out of range or NaN.
    """
    owner = type(options).__name__
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        values = value if isinstance(value, tuple) else (value,)
        if len(values) > MAX_VALUES:
            raise S2C2AError(
                f"{len(values)} values of {name} were given in {owner}; choose at most "
                f"{MAX_VALUES}"
            )
        # false for NaN
        if not all(low <= number <= high for number in values):
            raise S2C2AError(
                f"{name} = {value} was given in {owner}; choose {low:g} to {high:g}"
            )


@dataclass(frozen=True)
class Options:
    """Base of all options: a frozen dataclass that is read from a table of a file.

    Attributes:
        limits: of numbers, by the name of their field.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}
    limits: ClassVar[Ranges] = {}

    def __post_init__(self):
        """Check the limits."""
        check_limits(self, self.limits)


@dataclass(frozen=True)
class Component(Options):
    """Base of the parts of planner and estimator; all numbers have limits.

    Attributes:
        name: name of the class, by which files refer to it.
    """

    name: str = field(init=False)

    def __post_init__(self):
        """Name the class and check all numbers."""
        object.__setattr__(self, "name", type(self).__name__)
        limits = {
            each.name: COMPONENT_LIMITS.get(each.name, (0, LARGEST))
            for each in fields(self)
            if isinstance(getattr(self, each.name), int | float)
        }
        check_limits(self, limits)


@dataclass(frozen=True)
class CustomComponent(Options):
    """Reference to a component outside the package; `Registry.build` imports it.

    Attributes:
        name: `file.py:Name`, `module:Name` or the name of an entry point
            (`s2c2a.plugins.resolve`).
        parameters: arguments of its constructor.
    """

    name: str
    parameters: dict[str, bool | int | float | str] = field(
        default_factory=dict, hash=False
    )

    def __post_init__(self):
        """Check that all numbers are finite."""
        for name, value in self.parameters.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise S2C2AError(
                    f"{name} = {value} was given to {self.name}; write a finite number"
                )


Base = TypeVar("Base")


@dataclass(frozen=True)
class Registry(Generic[Base]):
    """Classes of one kind, by name.

    Attributes:
        kind: such as "solver"; also names the group of entry points (`plugins.GROUPS`).
        base: that all of them derive from.
        known: those of the package, by name.
    """

    kind: str
    base: type
    known: Mapping[str, type[Base]]

    def named(self, name: str) -> type[Base]:
        """Find a class by a name that the user gave; its module or file is imported.

        Names from files that may be a stranger's go to `find` or `imported` instead.

        Raises:
            S2C2AError: nothing of this name.
            StrategyError: it does not derive from the base.
        """
        trust_code(name)
        return self.find(name)

    def find(self, name: str) -> Any:
        """Find a class by name; custom code is imported if the user has named it.

        Raises:
            UntrustedCodeError: the user has not named its code (`plugins.trust_code`).
            S2C2AError: nothing of this name.
            StrategyError: it does not derive from the base.
        """
        found = resolve(self.kind, name, self.known)
        if not (isinstance(found, type) and issubclass(found, self.base)):
            raise self._not_of_this_kind(name)
        return found

    def imported(self, name: str) -> type[Base]:
        """Find a class by the name that a weight file holds (`name_of`).

        Nothing is imported unless the user has installed it, as an entry point, or named
        this code (`plugins.trust_code`).

        Raises:
            UntrustedCodeError: the class is not the package's, not imported already, not
                installed, and not trusted.
        """
        if name in self.known:
            return self.known[name]
        for found in _subclasses(self.base):
            if self.name_of(found) == name:
                return found
        if trusted := trusted_as(name):
            return self.find(trusted)
        if name in installed(self.kind):
            return self.find(name)
        raise UntrustedCodeError(
            f"its {self.kind} is '{name}', which is not part of the package, and files "
            f"cannot run code; if you trust it, add --trust {name} in the folder of its "
            f"file, or --trust with the path of the file, such as "
            f"path/{name.replace(':', '.py:')}; or import it in Python"
        )

    def name_of(self, options: type) -> str:
        """The name of a class in files."""
        for name, known in self.known.items():
            if known is options:
                return name
        own = f"{options.__module__}:{options.__qualname__}"
        for name, point in installed(self.kind).items():
            if point.value == own:
                return name
        return own

    def read(self, value: Any) -> Any:
        """Component from a table of a file or from a name; components pass unchanged.

        Raises:
            ValueError: the value is neither (pydantic's `ValidationError` is one).
        """
        if isinstance(value, Options):
            return value
        if isinstance(value, str):
            value = {"name": value}
        table = TypeAdapter(dict).validate_python(value)
        component = self.known.get(str(table.get("name")))
        if component is None:
            return TypeAdapter(CustomComponent).validate_python(table)
        numbers = {key: number for key, number in table.items() if key != "name"}
        return TypeAdapter(component).validate_python(numbers)

    def build(self, component: Any) -> Base:
        """Return the component itself; import it if it is custom.

        Raises:
            UntrustedCodeError: the user has not named its code (`plugins.trust_code`).
            S2C2AError: the import fails, the component is of another kind, or its
                constructor rejects the parameters.
        """
        if isinstance(component, self.base):
            return cast(Base, component)
        if not isinstance(component, CustomComponent):
            raise self._not_of_this_kind(component)
        try:
            return self.find(component.name)(**component.parameters)
        except TypeError as error:
            raise S2C2AError(
                f"the {self.kind} {component.name} cannot be built from "
                f"{component.parameters}: {error}"
            ) from error

    def _not_of_this_kind(self, name: Any) -> StrategyError:
        base = f"{self.base.__module__}.{self.base.__name__}"
        kind = self.kind.replace("_", " ")
        return StrategyError(
            f"'{name}' is no {kind}; derive it from {base}, or name a subclass"
        )


def _subclasses(base: type) -> list[Any]:
    classes: list[Any] = [base]
    child: type
    for child in base.__subclasses__():
        classes += _subclasses(child)
    return classes
