"""Parts that recipes name: frozen dataclasses of checked numbers, of the package or found by name outside of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, NamedTuple

from pydantic import ConfigDict, TypeAdapter

from s2c2a.errors import S2C2AError
from s2c2a.plugins import found

LEAST = {"unit": 1e-6, "learning_rate": 1e-9, "iterations": 1}
"""Of numbers by these names; of all others zero."""
MOST = {"iterations": 10_000}
"""Of all others a million."""


@dataclass(frozen=True)
class Part:
    """A term, a guide, a solver, ...: its numbers are finite, not negative, and within `LEAST` and `MOST`.

    Attributes:
        name: of its class, by which files ask for it.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    name: str = field(init=False)

    def __post_init__(self):
        """Refuse what cannot be worked with."""
        object.__setattr__(self, "name", type(self).__name__)
        for name, value in (
            (each.name, getattr(self, each.name)) for each in fields(self)
        ):
            least = LEAST.get(name, 0)
            most = MOST.get(name, 1_000_000)
            if isinstance(value, int | float) and not least <= value <= most:
                raise S2C2AError(
                    f"{value} {name} asked for in {self}; take {least} to {most}"
                )


@dataclass(frozen=True)
class Own:
    """A part from outside the package, asked for by name; it is looked for when it is needed.

    Attributes:
        name: `file.py:Name`, `module:Name` or an entry point's
            (`s2c2a.plugins.found`).
        parameters: what it is built with.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    name: str
    parameters: dict[str, bool | int | float | str] = field(
        default_factory=dict, hash=False
    )


class Kind(NamedTuple):
    """Terms, guides, solvers, ...

    Attributes:
        name: of the kind.
        form: the class that they derive from.
        known: those of the package, by name.
    """

    name: str
    form: type[Part]
    known: Mapping[str, type[Part]]

    @classmethod
    def of(cls, name: str, form: type[Part], *known: type[Part]) -> "Kind":
        """With those of the package."""
        return cls(name, form, {part.__name__: part for part in known})

    def read(self, given: Any) -> Part | Own:
        """From a table of a file, or a name alone; parts pass as they are.

        Raises:
            ValueError: it is neither (pydantic's `ValidationError` is one).
        """
        if isinstance(given, Part | Own):
            return given
        table = (
            {"name": given}
            if isinstance(given, str)
            else TypeAdapter(dict).validate_python(given)
        )
        part = self.known.get(str(table.get("name")))
        if part is None:
            return TypeAdapter(Own).validate_python(table)
        return TypeAdapter(part).validate_python(
            {key: value for key, value in table.items() if key != "name"}
        )

    def made(self, part: Part | Own, own_code: bool) -> Any:
        """The part to work with.

        Args:
            part: of the package, or by name.
            own_code: whether files and modules may be imported for it.

        Raises:
            S2C2AError: it may not be or cannot be imported, is of another kind, or does
                not take its parameters.
        """
        if isinstance(part, Own):
            part = self._found(part, own_code)
        if not isinstance(part, self.form):
            raise S2C2AError(
                f"{part} is no {self.name}; derive it from {self.form.__module__}.{self.form.__name__}"
            )
        return part

    def _found(self, own: Own, own_code: bool) -> Any:
        if ":" in own.name and not own_code:
            raise S2C2AError(
                f"the {self.name} {own.name} is code, which a strategy file cannot ask for; name it in a recipe file "
                "of your own and give that with --recipe"
            )
        try:
            return found(self.name, own.name, self.known)(**own.parameters)
        except TypeError as error:
            raise S2C2AError(
                f"the {self.name} {own.name} cannot be built from {own.parameters}: {error}"
            ) from error
