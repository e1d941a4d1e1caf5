"""Base classes of descriptions: frozen tables of numbers with units and ranges."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

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
    model_serializer,
)
from pydantic_core import CoreSchema, PydanticKnownError
from pydantic_core.core_schema import no_info_after_validator_function

from s2c2a.validation import EACH, ONE


def between(
    low: float, high: float, unit: str, meaning: str, default: Any = ...
) -> Any:
    """Declare a number with the range of plausible arms.

    A value wrong by a factor of 1000 is outside most ranges.
    """
    return Field(default, ge=low, le=high, description=f"{meaning} [{unit}]")


def _reject_text_and_bool(value):
    if isinstance(value, str | bool):
        raise ValueError(f"a number is needed, without quotes, got {value!r}")
    return value


Number = Annotated[float, BeforeValidator(_reject_text_and_bool)]


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
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=False
    )
    omitted_defaults: ClassVar[frozenset[str]] = frozenset()

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
