"""Readable validation errors: for each key, what is allowed and what was given."""

import re
from collections.abc import Callable, Iterable
from typing import Any

from pydantic import BaseModel, ValidationError

from s2c2a.errors import MAX_NAME_LENGTH, counted, nearest_name

ONE = "one"
EACH = "each"
"""Tags of the alternatives of a union type (one value, or one value per item).

Pydantic adds them to the location of an error; they are no keys of the file."""
TYPE_TAG = re.compile(r"(constrained-)?(str|int|float)|(tuple|list|literal)\[.*")
"""Tags that pydantic chooses for alternatives without a tag of ours."""
# limits of the message, since every line of a file may be wrong
MAX_ERRORS = 20  # lines, as a terminal shows at once
MAX_VALUE_LENGTH = 400  # letters, some lines
UNKNOWN_KEY = "extra_forbidden", "unexpected_keyword_argument"
MESSAGES = {
    "missing": "this key is missing",
    "string_type": "write text, in quotes",
    "tuple_type": "write a list, in brackets; of tables, each below [[its name]]",
    "union_tag_invalid": "{discriminator} is '{tag}'; write one of {expected_tags}",
    "model_type": "write a table of keys",
    "dataclass_type": "write a table of keys",
    "int_type": "write a whole number",
    "int_parsing": "write a whole number",
    "int_from_float": "write a whole number",
    "float_type": "write a number",
    "float_parsing": "write a number",
    "bool_type": "write true or false",
    "bool_parsing": "write true or false",
    "literal_error": "write {expected}",
    "finite_number": "write a finite number",
    "less_than_equal": "write {le} or less",
    "greater_than_equal": "write {ge} or more",
    "less_than": "write less than {lt}",
    "greater_than": "write more than {gt}",
    "too_short": "give at least {min_length}",
    "too_long": "give at most {max_length}",
    "string_pattern_mismatch": "write text of the form {pattern}",
    "string_too_short": "write something",
    "string_too_long": "write at most {max_length} letters",
}
"""Messages by pydantic's type of error, where its own speak of Python."""


def key_names(description: type[BaseModel]) -> set[str]:
    """Names of all keys of a file, those of its tables among them."""
    schema = description.model_json_schema()
    tables = [schema, *schema.get("$defs", {}).values()]
    return {name for table in tables for name in table.get("properties", ())}


def explained(
    error: ValidationError,
    heading: str,
    known: Iterable[str],
    hint: Callable[[Any], str] | None = None,
) -> str:
    """Format a validation error as a heading and one line for each key.

    Args:
        error: from pydantic.
        heading: first line; {faults} stands for their number.
        known: valid keys of the file, suggested for misspelled ones.
        hint: returns text to append to the line of an error.
    """
    known = set(known)
    by_key: dict[str, list[Any]] = {}
    for fault in _without_consequences(error.errors(include_url=False)):
        by_key.setdefault(_key(fault), []).append(fault)
    lines = [heading.replace("{faults}", counted(len(by_key), "fault"))]
    for key, faults in list(by_key.items())[:MAX_ERRORS]:
        # a union type gives one error for each of its alternatives
        messages = dict.fromkeys(
            describe_fault(fault, known)[:MAX_VALUE_LENGTH] for fault in faults
        )
        line = f"  {key}: {', or '.join(messages)}{_given_value(faults[0])}"
        if hint:
            line += hint(faults[0])
        lines.append(line)
    return "\n".join(lines)


def describe_fault(fault: Any, known: Iterable[str] = ()) -> str:
    """Say what is wrong with a value and what is allowed."""
    kind = fault["type"]
    if kind == "missing" and isinstance(fault["loc"][-1], int):
        return f"number {fault['loc'][-1] + 1} is missing"
    if kind in UNKNOWN_KEY:
        return unknown_key(fault["loc"][-1], known)
    message = MESSAGES.get(kind, "").format(**fault.get("ctx", {}))
    return message or fault["msg"].removeprefix("Value error, ")


def unknown_key(key: Any, known: Iterable[str]) -> str:
    """Say that a key is unknown, and what a misspelled one may mean."""
    # a key of a nested table is known with its path, such as planner.solver.iterations
    paths = {path.rpartition(".")[2]: path for path in sorted(known, reverse=True)}
    nearest = nearest_name(str(key), paths)
    if not nearest:
        return "no such key"
    if nearest == key:
        return "no such key here, though another table has one"
    return f"no such key; did you mean {paths[nearest]}?"


def _without_consequences(faults: list[Any]) -> list[Any]:
    """Drop the errors that a list is too short because all its items are invalid."""
    parents: set[tuple] = set()
    for fault in faults:
        location = fault["loc"]
        parents.update(location[:depth] for depth in range(len(location)))
    return [
        fault
        for fault in faults
        if fault["type"] != "too_short" or fault["loc"] not in parents
    ]


def _key(fault: Any) -> str:
    """Dotted key of an error, as the user wrote it."""
    *parents, last = fault["loc"] or ("",)
    parts = [part for part in parents if not _is_type_tag(part)]
    # a misspelled key may look like a tag
    if fault["type"] in UNKNOWN_KEY or not _is_type_tag(last):
        parts.append(last)
    return ".".join(str(part)[:MAX_NAME_LENGTH] for part in parts) or "file"


def _is_type_tag(part: Any) -> bool:
    return part in (ONE, EACH) or bool(TYPE_TAG.fullmatch(str(part)))


def _given_value(fault: Any) -> str:
    value = fault["input"]
    is_simple = isinstance(value, int | float | bool | str | list | tuple)
    if not is_simple or fault["type"] == "value_error":
        return ""
    return f" (got {value!r:.{MAX_VALUE_LENGTH}})"
