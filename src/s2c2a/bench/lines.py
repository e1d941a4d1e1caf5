"""Lines of a report as JSON, between processes and in files."""

from dataclasses import asdict, dataclass, replace
from typing import Any

from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.bench.measurement import Growth, Limit, Measurement, Skipped
from s2c2a.bench.options import BenchOptions


@dataclass(frozen=True)
class Failed:
    """A part that could not go on, and why."""

    what: str
    why: str


Line = Measurement | Growth | Skipped | Failed
KINDS: dict[str, type[Line]] = {kind.__name__: kind for kind in (Measurement, Growth, Skipped, Failed)}


def line_to_json(line: Line) -> dict[str, Any]:
    """A line as plain values."""
    return {"kind": type(line).__name__} | asdict(line)


def line_from_json(values: dict[str, Any]) -> Line:
    """The line that `line_to_json` was given."""
    fields = dict(values)
    kind = KINDS[fields.pop("kind")]
    if fields.get("limit"):
        fields["limit"] = Limit(**fields["limit"])
    return kind(**fields)


def options_to_json(options: BenchOptions) -> dict[str, Any]:
    """Options as plain values; the arm as the text of its file."""
    return vars(options) | {"arm": arm_to_toml(options.arm)}


def options_from_json(values: dict[str, Any]) -> BenchOptions:
    """The options that `options_to_json` was given."""
    return BenchOptions(**values | {"arm": arm_from_toml(values["arm"])})


def held_to_limits(line: Line, arm: ArmSpec, twin: ArmSpec) -> Line:
    """The line, without its limit if the arm is another than the one that limits are for."""
    if isinstance(line, Measurement) and not arm.same_body(twin):
        return replace(line, limit=None)
    return line
