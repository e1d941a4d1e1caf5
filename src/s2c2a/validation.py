"""Faults of a file that a user wrote, told in plain words: of each the key, what is allowed, and what was got."""

import re
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

ONE = "one"
EACH = "each"
"""What tells two kinds of value of one key apart; no user has written it."""
KIND = re.compile(r"(constrained-)?(str|int|float)|(tuple|list|literal)\[.*")
"""The same, where a kind has no name of ours."""
# told, of a file that may be all faults
MOST = 20
LONGEST_NAME = 64
LONGEST = 400
WORDS = {
    "missing": "this key is missing",
    "string_type": "write text, in quotes",
    "tuple_type": "write a list, in brackets",
    "model_type": "write a table of keys",
    "dataclass_type": "write a table of keys",
}
WORDS |= dict.fromkeys(
    ("int_type", "int_parsing", "int_from_float"), "write a whole number"
)
WORDS |= dict.fromkeys(("float_type", "float_parsing"), "write a number")
WORDS |= dict.fromkeys(("bool_type", "bool_parsing"), "write true or false")
"""By kind of fault, where pydantic speaks of Python."""
UNKNOWN = "extra_forbidden", "unexpected_keyword_argument"
KEY_WORDS = {
    "literal_error": "write {expected}",
    "finite_number": "write a finite number",
}
KEY_WORDS |= {
    "less_than_equal": "write {le} or less",
    "greater_than_equal": "write {ge} or more",
}
KEY_WORDS |= {
    "less_than": "write less than {lt}",
    "greater_than": "write more than {gt}",
}
KEY_WORDS |= {
    "too_short": "give at least {min_length}",
    "too_long": "give at most {max_length}",
}
KEY_WORDS |= {"string_pattern_mismatch": "write text of the form {pattern}"}
KEY_WORDS |= {
    "string_too_short": "write something",
    "string_too_long": "write at most {max_length} letters",
}
"""The same, with what is allowed."""


def explained(
    error: ValidationError,
    heading: str,
    known: Iterable[str],
    hint: Callable[[Any], str] | None = None,
) -> str:
    """A heading, and a line for each fault.

    Args:
        error: what pydantic found.
        heading: of what, with {count} where the number of faults stands.
        known: keys that the file can have, offered where one is misspelt.
        hint: what else to say of a fault, if anything.
    """
    known = set(known)
    faults = error.errors(include_url=False)
    # where every part of a list is faulty, pydantic adds that none is left: true, and
    # no help
    inside = {
        fault["loc"][:count] for fault in faults for count in range(len(fault["loc"]))
    }
    faults = [
        fault
        for fault in faults
        if not (fault["type"] == "too_short" and fault["loc"] in inside)
    ]
    places: dict[str, list[Any]] = {}
    for fault in faults:
        places.setdefault(_place(fault), []).append(fault)
    lines = [heading.replace("{count}", str(len(places)))]
    # others: of the kinds of value that a key can have
    for place, (fault, *others) in list(places.items())[:MOST]:
        words = dict.fromkeys(said(one, known)[:LONGEST] for one in (fault, *others))
        lines.append(
            f"  {place}: {', or '.join(words)}{_got(fault)}{hint(fault) if hint else ''}"
        )
    return "\n".join(lines)


def said(fault: Any, known: Iterable[str] = ()) -> str:
    """What is wrong, and what is allowed."""
    kind = fault["type"]
    if kind in UNKNOWN:
        near = get_close_matches(
            str(fault["loc"][-1])[:LONGEST_NAME], sorted(known), n=1
        )
        if near == [fault["loc"][-1]]:
            return "no such key here, though another table has one"
        return f"no such key{f'; did you mean {near[0]}?' if near else ''}"
    allowed = KEY_WORDS.get(kind, "").format(**fault.get("ctx", {}))
    return WORDS.get(kind) or allowed or fault["msg"].removeprefix("Value error, ")


def _place(fault: Any) -> str:
    *before, last = fault["loc"] or ("",)
    # who misspells one may write any word
    key = fault["type"] in UNKNOWN or not _names_a_kind(last)
    written = [part for part in before if not _names_a_kind(part)] + [last] * key
    keys = [str(part)[:LONGEST_NAME] for part in written]
    return ".".join(keys) or "file"


def _names_a_kind(part: Any) -> bool:
    return part in (ONE, EACH) or bool(KIND.fullmatch(str(part)))


def _got(fault: Any) -> str:
    simple = isinstance(fault["input"], int | float | bool | str | list | tuple)
    return (
        f" (got {fault['input']!r:.{LONGEST}})"
        if simple and fault["type"] != "value_error"
        else ""
    )
