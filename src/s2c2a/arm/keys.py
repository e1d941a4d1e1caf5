"""Documentation of the keys of an arm file, derived from the description's schema."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from s2c2a.arm.spec import ArmSpec


class Key(NamedTuple):
    """One key of an arm file.

    Attributes:
        table: its table, such as `[motor]` or `[[modules]]`; empty for the arm itself.
        name: name of the key.
        allowed: allowed values.
        otherwise: default, or "required".
        meaning: description with the unit in brackets.
    """

    table: str
    name: str
    allowed: str
    otherwise: str
    meaning: str


def file_keys() -> list[Key]:
    """Return all keys, table by table."""
    schema = ArmSpec.model_json_schema()
    return list(_keys_of(schema, schema["$defs"], "", ""))


def _keys_of(
    schema: dict, kinds: dict[str, dict], path: str, table: str
) -> Iterator[Key]:
    inner = []
    for name, value in schema["properties"].items():
        form = value
        for alternative in reversed(value.get("anyOf", ())):
            if alternative.get("type") != "null":
                form = alternative
        kind = form.get("$ref") or form.get("items", {}).get("$ref")
        if kind:
            if "items" in form:
                allowed = "tables"
                if "maxItems" in form:
                    allowed = f"{form['minItems']} to {form['maxItems']} tables"
                default = "required" if name in schema["required"] else "none"
                yield Key(table, name, allowed, default, value["description"])
            inner.append((name, "items" in form, kinds[kind.rsplit("/", 1)[-1]]))
            continue
        otherwise = "required"
        if name not in schema["required"]:
            otherwise = _format_value(value["default"])
        allowed = value.get("allowed") or _allowed(form)
        meaning = value.get("description") or form.get("description", "")
        yield Key(table, name, allowed, otherwise, meaning)
    for name, is_row, kind in inner:
        inner_path = f"{path}.{name}".strip(".")
        title = f"[[{inner_path}]]" if is_row else f"[{inner_path}]"
        yield from _keys_of({"required": ()} | kind, kinds, inner_path, title)


def _allowed(form: dict) -> str:
    """Describe the allowed values of a key.

    The range of a number is `ge` and `le` after a custom validator, and `minimum` and
    `maximum` otherwise.
    """
    low = form.get("ge", form.get("minimum"))
    high = form.get("le", form.get("maximum"))
    if low is not None:
        whole = "whole, " if form["type"] == "integer" else ""
        return f"{whole}{low:.10g} to {high:.10g}"
    if "allowed" in form:
        return form["allowed"]
    if "enum" in form:
        return " or ".join(f'"{choice}"' for choice in form["enum"])
    if form["type"] == "array":
        least = form.get("minItems")
        most = form.get("maxItems")
        if most is None:
            return "rows of numbers"
        if least is None:
            return f"up to {most} numbers"
        return f"{least} numbers" if least == most else f"{least} to {most} numbers"
    if form["type"] == "boolean":
        return "true or false"
    if form["type"] != "string":
        raise NotImplementedError(f"keys of this form have no description yet: {form}")
    return "letters, digits, - and _" if "pattern" in form else "text"


def _format_value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_format_value, value)) + "]"
    return "none" if value is None else f"{value:.10g}"
