"""Lines as the cells of a table."""

import math
from collections.abc import Sequence

from s2c2a.bench.lines import Failed, Line
from s2c2a.bench.measurement import Limit, Measurement, Skipped

UNITS = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
HEADER = ("what", "median", "99th percentile", "repeats", "limit", "beside it")


def table_rows(lines: Sequence[Line]) -> list[tuple[str, ...]]:
    """A row for every line; growths are drawn, not printed, their exponents have lines of their own."""
    rows = []
    for line in lines:
        if isinstance(line, Measurement):
            rows.append(_measured(line))
        elif isinstance(line, Skipped):
            rows.append((line.what, "skipped", "", "", "", line.why))
        elif isinstance(line, Failed):
            rows.append((line.what, "FAILED", "", "", "", line.why))
    return rows


def value_in(unit: str, value: float) -> str:
    """A number with its unit, as people read it."""
    if not math.isfinite(value):
        return "-"
    if unit == "s":
        return _time(value)
    digits = max(0, 2 - math.floor(math.log10(abs(value)))) if 0 < abs(value) < 1000 else 0
    number = f"{value:.{digits}f}" if abs(value) >= 0.01 or value == 0 else f"{value:.1e}"
    return number if unit == "1" else f"{number} {unit}"


def _time(seconds: float) -> str:
    unit, size = next((pair for pair in UNITS if seconds >= pair[1]), UNITS[-1])
    return f"{seconds / size:.3g} {unit}" if seconds < 1000 else f"{seconds:.0f} s"


def _measured(line: Measurement) -> tuple[str, ...]:
    tail = "" if line.percentile_99 is None else value_in(line.unit, line.percentile_99)
    error = "" if line.error is None else f"error {1e3 * line.error:.2f} mm"
    beside = "; ".join(part for part in (error, line.note) if part)
    limit = "" if line.limit is None else f"{_limit(line.unit, line.limit)} {'kept' if line.kept else 'MISSED'}"
    return line.what, value_in(line.unit, line.median), tail, str(line.repeats), limit, beside


def _limit(unit: str, limit: Limit) -> str:
    sign = "≥" if limit.at_least else "≤"
    tail = "" if limit.percentile_99 is None else f", 99 %: ≤ {value_in(unit, limit.percentile_99)}"
    return f"{sign} {value_in(unit, limit.median)}{tail}"
