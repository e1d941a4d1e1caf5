"""Short texts of values with arrays, and of what differs between tables."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from wadler_lindig import AbstractDoc, TextDoc, pdoc, pformat


def short_text(value: Any) -> str:
    """Fields of a value, with types and shapes in place of arrays."""
    return pformat(value, custom=_short)


def _short(part: Any) -> AbstractDoc | None:
    """What differs from the library: tables that none can change, and single numbers."""
    if isinstance(part, MappingProxyType):
        return pdoc(dict(part), custom=_short)
    is_number = hasattr(part, "dtype") and part.shape == ()
    return TextDoc(str(part)) if is_number else None


def differences(before: Any, after: Any, key: str = "") -> list[str]:
    """Name every key whose value changed in nested tables, with both values."""
    if before == after:
        return []
    old = _entries(before)
    new = _entries(after)
    if old is None or new is None:
        return [f"{key} {before!r:.60}, now {after!r:.60}"]
    found = []
    for name in {**old, **new}:
        path = f"{key}.{name}" if key else str(name)
        found += differences(old.get(name), new.get(name), path)
    return found


def _entries(value: Any) -> dict[Any, Any] | None:
    """Entries of a table or of a list of tables; None of other values."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, tuple) and value and isinstance(value[0], Mapping):
        return dict(enumerate(value))
    return None
