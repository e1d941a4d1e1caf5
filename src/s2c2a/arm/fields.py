"""What descriptions are made of: frozen tables of numbers with units and ranges."""

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
    """A number with the range of plausible arms; a value wrong by a factor of 1000 falls outside of it."""
    return Field(default, ge=low, le=high, description=f"{meaning} [{unit}]")


def _refuse_text_and_truth(value):
    if isinstance(value, str | bool):
        raise ValueError(f"a number is needed, without quotes, got {value!r}")
    return value


Number = Annotated[float, BeforeValidator(_refuse_text_and_truth)]


Numbers = Annotated[
    Annotated[Number, Tag(ONE)] | Annotated[tuple[Number, ...], Tag(EACH)],
    Discriminator(lambda value: EACH if isinstance(value, list | tuple) else ONE),
]
"""One for all cables of a module, or one each."""


@dataclass(frozen=True)
class Within:
    """The range of such numbers, in a key's annotation."""

    low: float
    high: float

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """They are checked once they are numbers."""
        return no_info_after_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """In words."""
        return {"allowed": f"{self.low:.10g} to {self.high:.10g}, one or one a cable"}

    def _checked(self, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        each = value if isinstance(value, tuple) else (value,)
        if not each:
            raise PydanticKnownError(
                "too_short",
                {"field_type": "Tuple", "min_length": 1, "actual_length": 0},
            )
        if min(each) < self.low:
            raise PydanticKnownError("greater_than_equal", {"ge": self.low})
        if max(each) > self.high:
            raise PydanticKnownError("less_than_equal", {"le": self.high})
        return value


class Frozen(BaseModel):
    """A table of a file.

    Attributes:
        unsaid: keys that are left out of a file where they say nothing, so that arms
            without them stay the same to the byte, and with them all that is kept by
            what is made of them.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=False
    )
    unsaid: ClassVar[frozenset[str]] = frozenset()

    @model_serializer(mode="wrap")
    def _as_said(self, written) -> dict[str, Any]:
        """Without what is unsaid."""
        silent = {
            name
            for name in self.unsaid
            if getattr(self, name) == type(self).model_fields[name].default
        }
        return {
            name: value for name, value in written(self).items() if name not in silent
        }


def largest_gap_deg(angles_deg: Iterable[float]) -> float:
    """Largest angle between neighboring cables [deg]."""
    around = np.sort(np.mod(np.fromiter(angles_deg, float), 360.0))
    return float(np.max(np.diff(np.append(around, around[0] + 360.0))))
