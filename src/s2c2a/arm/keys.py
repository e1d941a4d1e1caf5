"""The keys of an arm file, as the description itself knows them."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any, NamedTuple

from s2c2a.arm.sensors import Sensors
from s2c2a.arm.spec import ArmSpec

_INNER = {f"modules.{name}": f"[modules.{name}]" for name in ("cable", "mismatch")}
_SENSORS = {f"sensors.{name}": f"[sensors.{name}]" for name in Sensors.model_fields}
_ROWS = {"modules": "[[modules]]", "sensors.raw": "[[sensors.raw]]"}
_TABLES = (
    {"": "", "motor": "[motor]", "sensors": "[sensors]"} | _SENSORS | _ROWS | _INNER
)


class Key(NamedTuple):
    """One key.

    Attributes:
        table: where it stands: nothing for the arm itself, `[motor]`, `[[modules]]`,
            ....
        name: what stands left of the equals sign.
        allowed: its values, in words.
        otherwise: what holds if it is not stated.
        meaning: in words, its unit in brackets.
    """

    table: str
    name: str
    allowed: str
    otherwise: str
    meaning: str


def file_keys() -> list[Key]:
    """All of them, table after table."""
    schema = ArmSpec.model_json_schema()
    return [
        key._replace(table=_TABLES[key.table])
        for key in _keys_of(schema, schema["$defs"], "")
    ]


def keys_as_markdown() -> str:
    """A table for each table of the file."""
    tables = groupby(file_keys(), key=lambda key: key.table)
    return "\n".join(_as_markdown(table, rows) for table, rows in tables)


def _as_markdown(table: str, rows: Iterable[Key]) -> str:
    title = f"`{table}`" if table else "The arm itself"
    lines = [
        f"| `{key.name}` | {key.allowed} | {key.otherwise} | {key.meaning} |"
        for key in rows
    ]
    header = [
        f"### {title}\n",
        "| key | allowed | if not stated | what it is |",
        "| --- " * 4 + "|",
    ]
    return "\n".join([*header, *lines, ""])


def _keys_of(part: dict, kinds: dict[str, dict], table: str) -> Iterator[Key]:
    inner = []
    for name, value in part["properties"].items():
        form = next(
            (one for one in value.get("anyOf", ()) if one.get("type") != "null"), value
        )
        kind = form.get("$ref") or form.get("items", {}).get("$ref")
        if kind:
            if "items" in form:
                allowed = f"{form['minItems']} to {form['maxItems']} tables"
                needed = "needed" if name in part["required"] else "none"
                yield Key(table, name, allowed, needed, value["description"])
            inner.append((f"{table}.{name}".strip("."), kinds[kind.rsplit("/", 1)[-1]]))
            continue
        otherwise = "needed" if name in part["required"] else _written(value["default"])
        allowed = value.get("allowed") or _allowed(form)
        yield Key(
            table,
            name,
            allowed,
            otherwise,
            value.get("description") or form.get("description", ""),
        )
    for path, kind in inner:
        yield from _keys_of({"required": ()} | kind, kinds, path)


def _allowed(form: dict) -> str:
    """Behind a validator of our own a number's range is `ge` and `le`, as pydantic has it; else as JSON Schema has."""
    low = form.get("ge", form.get("minimum"))
    high = form.get("le", form.get("maximum"))
    if low is not None:
        whole = "whole, " if form["type"] == "integer" else ""
        return f"{whole}{low:.10g} to {high:.10g}"
    if "allowed" in form:
        return form["allowed"]
    if "enum" in form:
        return " or ".join(f'"{one}"' for one in form["enum"])
    if form["type"] == "array":
        least = form.get("minItems")
        most = form.get("maxItems")
        if least is None:
            return "rows of numbers"
        return f"{least} numbers" if least == most else f"{least} to {most} numbers"
    if form["type"] == "boolean":
        return "true or false"
    if form["type"] != "string":
        raise NotImplementedError(f"a key of this form is not explained yet: {form}")
    return "letters, digits, - and _" if "pattern" in form else "text"


def _written(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_written(one) for one in value) + "]"
    return "none" if value is None else f"{value:.10g}"
