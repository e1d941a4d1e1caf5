"""What the readers of exports of motion capture systems give."""

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class CaptureExport:
    """Export of a motion capture system.

    Attributes:
        names: names of the columns.
        rows: line numbers and cells of the rows.
        length_unit: unit of lengths, such as "mm"; empty if it is not known.
        decimal_comma: whether numbers may have a decimal comma.
    """

    names: list[str]
    rows: Iterator[tuple[int, list[str]]]
    length_unit: str
    decimal_comma: bool = False
