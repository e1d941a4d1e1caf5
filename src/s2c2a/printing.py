"""Short texts of values with arrays, for `print` and notebooks."""

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
