"""Base classes of descriptions: frozen tables of numbers with units and ranges."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Tag,
    ValidationError,
    model_serializer,
)
from pydantic_core import CoreSchema, PydanticKnownError
from pydantic_core.core_schema import no_info_after_validator_function

from s2c2a.errors import ArmError, S2C2AError
from s2c2a.files.text import LARGEST, parse_toml
from s2c2a.files.validation import EACH, ONE, explained, key_names


def between(
    low: float, high: float, unit: str, meaning: str, default: Any = ...
) -> Any:
    """Declare a number with the range of plausible arms.

    A value wrong by a factor of 1000 is outside most ranges.
    """
    return Field(default, ge=low, le=high, description=f"{meaning} [{unit}]")


@dataclass(frozen=True)
class Quantity:
    """Unit of several keys, and the range of plausible arms."""

    unit: str
    low: float
    high: float

    def key(self, meaning: str, default: Any = ...) -> Any:
        """Declare a number in this range."""
        return between(self.low, self.high, self.unit, meaning, default)

    def effect(self, meaning: str, default: Any = 0.0) -> Any:
        """Declare the size of an effect, which may be zero and is so by default."""
        return between(0, self.high, self.unit, meaning, default)


def optional(meaning: str, default: Any = None, **limits: Any) -> Any:
    """Declare a key that a file may leave out."""
    return Field(default, description=meaning, **limits)


def absent(meaning: str) -> Any:
    """Declare a number that is zero unless the file states it."""
    return optional(meaning, 0.0)


LENGTH = Quantity("m", 0.0005, 2)
"""A radius of half a millimeter to a module of two meters."""
LOST_MOTION = Quantity("m", 0, 0.02)
"""More would be seen: the diameter of a thumb."""
FORCE = Quantity("N", 0.05, 500)
"""From the weight of a coin, above the noise of load cells, to what steel cables of
1 mm bear."""
PRESSURE = Quantity("Pa", 1000, 2e6)
"""Soft chambers burst long before; a pressure in bar or kPa is below it."""
RIGIDITY = Quantity("N m2", 1e-8, 50)
"""From a wire of a surgical robot; the arms of the package have 0.125 and 0.4, and a
bending stiffness in N mm2 exceeds it."""
MASS = Quantity("kg", 1e-6, 10)
"""A drop of glue to a segment of a robot's arm of metal; grams exceed it."""
SHARE = Quantity("1", 0, 1)
"""Of a whole, by definition; also a friction coefficient."""
ERROR = Quantity("1", -0.9, 9)
"""Of a nominal value: the true one is a tenth to ten times as large."""


def _reject_text_and_bool(value):
    if isinstance(value, str | bool):
        raise ValueError(f"a number is needed, without quotes, got {value!r}")
    return value


Number = Annotated[float, BeforeValidator(_reject_text_and_bool)]
Free = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]
"""A number without a range of its own, such as an azimuth."""


Numbers = Annotated[
    Annotated[Number, Tag(ONE)] | Annotated[tuple[Number, ...], Tag(EACH)],
    Discriminator(lambda value: EACH if isinstance(value, list | tuple) else ONE),
]
"""One number for all cables of a module, or one number for each."""


@dataclass(frozen=True)
class Within:
    """Range of `Numbers`, in the annotation of a key."""

    low: float
    high: float

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Check the range after the conversion to numbers."""
        return no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the range for `s2c2a arm keys`."""
        return {"allowed": f"{self.low:.10g} to {self.high:.10g}, one or one a cable"}

    def _check(self, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        values = value if isinstance(value, tuple) else (value,)
        if not values:
            raise PydanticKnownError(
                "too_short",
                {"field_type": "Tuple", "min_length": 1, "actual_length": 0},
            )
        if min(values) < self.low:
            raise PydanticKnownError("greater_than_equal", {"ge": self.low})
        if max(values) > self.high:
            raise PydanticKnownError("less_than_equal", {"le": self.high})
        return value


class Frozen(BaseModel):
    """Table of a file.

    Attributes:
        omitted_defaults: keys that are not written when they have their default. Files
            of arms without these keys, and caches keyed by them, stay the same.
        fault_type: error of values that are not allowed.
        described: what the file describes, in this error.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=False
    )
    omitted_defaults: ClassVar[frozenset[str]] = frozenset()
    fault_type: ClassVar[type[S2C2AError]] = ArmError
    described: ClassVar[str] = "arm description (modules count from 0, at the base)"

    @classmethod
    def from_toml(cls, text: str, source: str) -> Self:
        """Parse and validate the text of a file; `source` names it in errors.

        Raises:
            S2C2AError: see `parse_toml` and `validated`; of the table's own type.
        """
        try:
            values = parse_toml(text)
        except S2C2AError as error:
            raise cls.fault_type(f"{source}: {error}; correct that line") from error
        return cls.validated(values, source)

    @classmethod
    def validated(cls, values: Mapping[str, Any], source: str) -> Self:
        """Validate the values of a file.

        Raises:
            S2C2AError: a key is unknown or missing, or has an invalid value.
        """
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            heading = f"{source}: {{faults}} in the {cls.described}"
            faults = explained(error, heading, key_names(cls), _hint)
            raise cls.fault_type(faults) from error

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Self:
        """A copy with other values, which are checked as those of a file.

        Raises:
            S2C2AError: see `validated`.
        """
        copy = super().model_copy(update=update, deep=deep)
        # which also has what is in no file
        copy.__dict__ |= vars(self.validated(dict(copy), type(self).__name__))
        return copy

    @model_serializer(mode="wrap")
    def _without_defaults(self, serialize) -> dict[str, Any]:
        values = serialize(self)
        for name in self.omitted_defaults:
            if getattr(self, name) == type(self).model_fields[name].default:
                values.pop(name, None)
        return values


def largest_gap_deg(angles_deg: Iterable[float]) -> float:
    """Return the largest angle between neighboring cables [deg]."""
    angles = np.sort(np.mod(np.fromiter(angles_deg, float), 360.0))
    return float(np.max(np.diff(np.append(angles, angles[0] + 360.0))))


def _hint(fault) -> str:
    """Suggest wrong units where a number is outside its range."""
    out_of_range = fault["type"] in ("greater_than_equal", "less_than_equal")
    if not out_of_range or not fault["input"]:
        return ""
    if str(fault["loc"][-1]).endswith("_deg"):
        return "; this key is in degrees"
    return "; values are in SI units (m, kg, N, s, Hz): is it off by a factor of 1000?"
