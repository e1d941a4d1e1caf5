"""Pose tracking of a real arm: where the poses of its module ends come from."""

from typing import Annotated

from pydantic import Field, model_validator

from s2c2a.arm.fields import Frozen, optional
from s2c2a.errors import MAX_NAME_LENGTH

STRETCH = 0.1
"""Share by which a module may be longer than its length, or its chord shorter: well
above the shortening of real arms, 2 to 4 % (`randomized_arm`)."""
MOUNTING = 0.02
"""Largest distance of a tracked body from where it should be [m]: the size of a cluster
of markers."""
BodyName = Annotated[str, Field(max_length=MAX_NAME_LENGTH)]


class Tracking(Frozen):
    """Source and bodies of a pose tracker."""

    source: str = optional("source, such as udp:9763 or natnet:192.168.1.10", "udp")
    base: BodyName = optional(
        "body at the base; empty: the tracker's world frame replaces it", "base"
    )
    ends: tuple[BodyName, ...] | None = optional(
        "body at the end of every module, empty where none is tracked; default: "
        "end-1, end-2, ...",
        json_schema_extra={"allowed": "names"},
    )
    calibration: str = optional(
        "file of `s2c2a tracking latency` and `frames`; default: "
        "NAME.tracking.json in the current folder, if it exists",
        "",
    )

    @model_validator(mode="after")
    def _validate(self):
        if not self.source:
            raise ValueError(
                "tracking.source is empty; name a source, such as udp:9763, or leave "
                "out the table [tracking]"
            )
        if self.ends is None:
            return self
        tracked = [name for name in (self.base, *self.ends) if name]
        if not any(self.ends) or len(set(tracked)) < len(tracked):
            raise ValueError(
                f"tracking.base is {self.base!r}, tracking.ends are {list(self.ends)}; "
                "name at least one end, and every body once"
            )
        return self

    def end_names(self, modules: int) -> tuple[str, ...]:
        """Return the body at the end of every module; empty where none is tracked."""
        if self.ends is not None:
            return self.ends
        return tuple(f"end-{module}" for module in range(1, modules + 1))
