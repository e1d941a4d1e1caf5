"""Registries of options classes: forward models, controllers and strategies by name.

A name is one of the package's, an entry point of `s2c2a.<kind>s`, `module:Class` or
`file.py:Class`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from s2c2a.errors import StrategyError, UntrustedCodeError
from s2c2a.plugins import is_trusted, resolve, trust_code

Base = TypeVar("Base")


@dataclass(frozen=True)
class OptionsRegistry(Generic[Base]):
    """Options classes of one kind.

    Attributes:
        kind: such as "model"; also names the group of entry points, `s2c2a.models`.
        base: that all of them derive from.
        known: those of the package, by name.
    """

    kind: str
    base: type[Base]
    known: Mapping[str, type[Base]]

    def named(self, name: str) -> type[Base]:
        """Find a class by a name that the user gave; its module or file is imported.

        Names from recordings and weight files go to `imported` instead.

        Raises:
            S2C2AError: nothing of this name.
            StrategyError: it does not derive from the base.
        """
        trust_code(name)
        found = resolve(self.kind, name, self.known)
        if not (isinstance(found, type) and issubclass(found, self.base)):
            raise StrategyError(
                f"'{name}' is no {self.kind}; derive it from "
                f"{self.base.__module__}.{self.base.__name__}"
            )
        return found

    def imported(self, name: str) -> type[Base]:
        """Find a class by a name from a file of unknown origin.

        Nothing is imported unless the user has named this code (`plugins.trust_code`).

        Raises:
            UntrustedCodeError: the class is not the package's, not imported already,
                and not trusted.
        """
        for found in _subclasses(self.base):
            if self.name_of(found) == name:
                return found
        if is_trusted(name):
            return self.named(name)
        raise UntrustedCodeError(
            f"its {self.kind} is '{name}', which is not part of the package, and files "
            f"cannot run code; if you trust it, add --trust {name} in the folder of its "
            f"file, or, to `run`, `live` and `view`, --{self.kind} file.py:Name; or "
            "import it in Python"
        )

    def name_of(self, options: type) -> str:
        """The name of a class in files."""
        for name, known in self.known.items():
            if known is options:
                return name
        return f"{options.__module__}:{options.__qualname__}"


def _subclasses(base: type) -> list[type]:
    classes: list[type] = [base]
    child: type
    for child in base.__subclasses__():
        classes += _subclasses(child)
    return classes
