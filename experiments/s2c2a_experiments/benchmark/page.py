"""The static page of a benchmark: table, figure, and what every entrant is."""

import base64
import html
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from string import Template

from s2c2a.files.text import write_atomically
from s2c2a_experiments.benchmark.protocol import VERSION
from s2c2a_experiments.benchmark.results import (
    PlannerComparison,
    arm_table,
    dash_lines,
    failure_lines,
    header,
    lines,
)
from s2c2a_experiments.benchmark.scores import (
    ANGLE_BOUND,
    POSITION_BOUND,
    STRICTNESS,
)

BOUNDS = ", ".join(
    f"{factor * POSITION_BOUND:g} % (axes: {factor * ANGLE_BOUND:g} deg)"
    for factor in STRICTNESS
)
COLUMNS = {
    "success, held out": "mean over arms and tasks, but known payload, of the success of "
    f"runs: how many of three bounds they keep, {BOUNDS} of the arm's length; none with a "
    "touch; what an entrant does not do counts as none; ± standard deviation between seeds",
    "a task": "success; mean error of the runs that did not fail [% of the arm's length]; "
    "for some, share of runs that touch an obstacle, or error of the axis [deg]",
    "path length": "of the tip, over that of its goals; in tasks that all entrants do; "
    "less than 1 cuts corners",
    "jerk": "log dimensionless jerk of the tip, in the same tasks; larger trembles more",
    "settling": "median time until the tip stays within 5 % of a still target, past "
    "obstacles; the whole run where it does not, or touches",
    "step": "time of a control step, while the other cores run, too; median over tasks "
    "and arms",
    "data": "samples that the entrant learns from",
    "lines": "of its own file, with docstrings",
}
PAGE = resources.files("s2c2a_experiments.benchmark").joinpath("page.html")


def write_page(comparison: PlannerComparison, figure: Path, path: Path) -> Path:
    """Write the page, which needs no other file."""
    picture = base64.b64encode(figure.read_bytes()).decode()
    seeds = ", ".join(map(str, comparison.seeds))
    content = [
        "<h1>Planners compared</h1>",
        f"<p>Protocol version {VERSION}; seeds {seeds}. Arms: {_names(comparison)}. "
        f"Tasks: {', '.join(comparison.tasks)}.</p>",
        _table(header(comparison), lines(comparison)),
        f'<figure><img alt="Shares of runs below every error, and success over time of a '
        f'step" src="data:image/png;base64,{picture}"></figure>',
        "<h2>Success by arm</h2>",
        _table(*arm_table(comparison)),
        "<h2>Columns</h2>",
        _list([f"`{name}`: {text}" for name, text in COLUMNS.items()]),
        "<h2>Why there are dashes</h2>",
        _list(dash_lines(comparison) + failure_lines(comparison)),
        "<h2>Versions</h2>",
        _list(_versions(comparison)),
    ]
    template = Template(PAGE.read_text(encoding="utf-8"))
    text = template.substitute(content="\n".join(content))
    return write_atomically(text, path)


def _versions(comparison: PlannerComparison) -> list[str]:
    """What made the results, a line for all with the same versions."""
    lines = [
        ", ".join(f"{name} {number}" for name, number in result.versions.items())
        for result in comparison.results
    ]
    return list(dict.fromkeys(lines))


def _names(comparison: PlannerComparison) -> str:
    """Arms, those held out behind the others."""
    arms = ", ".join(comparison.arms(held_out=False))
    others = ", ".join(comparison.arms(held_out=True))
    return html.escape(f"{arms}; held out: {others or 'none'}")


def _table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    rows = [_row(head, "th"), *(_row(cells, "td") for cells in body)]
    return f"<table>{''.join(rows)}</table>"


def _row(cells: Sequence[str], tag: str) -> str:
    marked = "".join(f"<{tag}>{_text(cell)}</{tag}>" for cell in cells)
    return f"<tr>{marked}</tr>"


def _list(texts: Sequence[str]) -> str:
    items = "".join(f"<li>{_text(text)}</li>" for text in texts)
    return f"<ul>{items}</ul>"


def _text(markdown: str) -> str:
    """Escaped text; what is between backquotes is code."""
    parts = html.escape(markdown).split("`")
    for number in range(1, len(parts), 2):
        parts[number] = f"<code>{parts[number]}</code>"
    return "".join(parts)
