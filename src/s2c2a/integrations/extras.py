"""Packages of extras, imported where they are used."""

from collections.abc import Iterator
from contextlib import contextmanager

from s2c2a.errors import S2C2AError


@contextmanager
def needs_extra(extra: str, purpose: str) -> Iterator[None]:
    """Explain a missing package that is imported in the block.

    Args:
        extra: of the distribution.
        purpose: what needs it, as the subject of a sentence.

    Raises:
        S2C2AError: it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise S2C2AError(
            f"{purpose} needs packages that are not installed ({error}); install the "
            f'extra: pip install "s2c2a[{extra}]"'
        ) from error
