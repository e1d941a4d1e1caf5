"""Components that recipes name: cost terms, guides, solvers and fallback searches.

A component is a frozen dataclass of validated numbers. It comes with the package, or
is custom code that a recipe names.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, NamedTuple

from pydantic import ConfigDict, TypeAdapter

from s2c2a.errors import S2C2AError
from s2c2a.plugins import resolve

MIN_VALUES = {"unit": 1e-6, "learning_rate": 1e-9, "iterations": 1}
"""Lower limits by field name; all other fields have 0."""
MAX_VALUES = {"iterations": 10_000}
"""Upper limits by field name; all other fields have 1 000 000."""


@dataclass(frozen=True)
class Component:
    """Base of all components; numbers lie within `MIN_VALUES` and `MAX_VALUES`.

    Attributes:
        name: name of the class, by which files refer to it.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    name: str = field(init=False)

    def __post_init__(self):
        """Validate all numbers."""
        object.__setattr__(self, "name", type(self).__name__)
        for attribute in fields(self):
            self._check_range(attribute.name)

    def _check_range(self, name: str) -> None:
        value = getattr(self, name)
        if not isinstance(value, int | float):
            return
        lowest = MIN_VALUES.get(name, 0)
        highest = MAX_VALUES.get(name, 1_000_000)
        if not lowest <= value <= highest:
            raise S2C2AError(
                f"{name} = {value} was given in {self}; choose {lowest} to {highest}"
            )


@dataclass(frozen=True)
class CustomComponent:
    """Reference to a component outside the package; `build` imports it.

    Attributes:
        name: `file.py:Name`, `module:Name` or the name of an entry point
            (`s2c2a.plugins.resolve`).
        parameters: arguments of its constructor.
    """

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    name: str
    parameters: dict[str, bool | int | float | str] = field(
        default_factory=dict, hash=False
    )


class ComponentRegistry(NamedTuple):
    """Registry of one type of component: cost terms, guides, solvers, ...

    Attributes:
        name: of the type, such as "solver".
        form: base class of all components of this type.
        known: components of the package, by name.
    """

    name: str
    form: type[Component]
    known: Mapping[str, type[Component]]

    @classmethod
    def of(
        cls, name: str, form: type[Component], *known: type[Component]
    ) -> "ComponentRegistry":
        """Registry with these components of the package."""
        return cls(name, form, {component.__name__: component for component in known})

    def read(self, value: Any) -> Component | CustomComponent:
        """Component from a table of a file or from a name; components pass unchanged.

        Raises:
            ValueError: the value is neither (pydantic's `ValidationError` is one).
        """
        if isinstance(value, Component | CustomComponent):
            return value
        if isinstance(value, str):
            value = {"name": value}
        table = TypeAdapter(dict).validate_python(value)
        component = self.known.get(str(table.get("name")))
        if component is None:
            return TypeAdapter(CustomComponent).validate_python(table)
        numbers = {key: number for key, number in table.items() if key != "name"}
        return TypeAdapter(component).validate_python(numbers)

    def build(self, component: Component | CustomComponent) -> Any:
        """Return the component itself; import it if it is custom.

        Raises:
            UntrustedCodeError: the user has not named its code (`plugins.trust_code`).
            S2C2AError: the import fails, the component is of another type, or its
                constructor rejects the parameters.
        """
        if isinstance(component, CustomComponent):
            component = self._import(component)
        if not isinstance(component, self.form):
            raise S2C2AError(
                f"{component} is no {self.name}; derive it from "
                f"{self.form.__module__}.{self.form.__name__}"
            )
        return component

    def _import(self, custom: CustomComponent) -> Any:
        try:
            return resolve(self.name, custom.name, self.known)(**custom.parameters)
        except TypeError as error:
            raise S2C2AError(
                f"the {self.name} {custom.name} cannot be built from "
                f"{custom.parameters}: {error}"
            ) from error
