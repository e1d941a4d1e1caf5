"""What verbs print with: a progress bar, tables, and words that they share."""

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from s2c2a.evaluation.report import Row
    from s2c2a.progress import Progress

Arm = Annotated[str, tyro.conf.arg(metavar="PRESET|FILE")]
StrategyName = Literal["s2c2a", "pcc", "pcc-fitted", "lstm", "s2c2a-motor"]
FidelityName = Literal["fast", "accurate"]
_RECIPE = tyro.conf.arg(metavar="best|best-long|paper|FILE")
RecipeName = Annotated[str, _RECIPE]
OptionalRecipe = Annotated[str | None, _RECIPE]
ModelName = Annotated[str | None, tyro.conf.arg(metavar="module:Name|FILE.py:Name")]
GuardName = Literal["tip", "arm"]
WIDTH_IN_FILES = 120
BETWEEN_LINES = 20.0  # s, where progress goes to a file
KINDS = {".html": "replay", ".mp4": "video", ".gif": "video"}

File = tyro.conf.Positional[Annotated[str, tyro.conf.arg(metavar="NAME|FILE")]]


@contextmanager
def progress_bar() -> Iterator["Progress"]:
    """A progress that draws one bar a piece of work; where nobody watches, as in a file, lines now and then."""
    from rich import console, progress

    screen = console.Console(stderr=True)
    columns = (
        "{task.description}",
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
    )
    with progress.Progress(
        *columns, console=screen, disable=not screen.is_terminal
    ) as bars:
        tasks: dict[str, progress.TaskID] = {}
        said = dict[str, float]()

        def told(doing: str, done: int, total: int) -> None:
            if doing not in tasks:
                tasks[doing] = bars.add_task(doing, total=total)
            if (
                not screen.is_terminal
                and time.monotonic() > said.get(doing, -math.inf) + BETWEEN_LINES
            ):
                screen.print(
                    f"{doing}: {done} of {total}" if doing in said else f"{doing} ...",
                    highlight=False,
                )
                said[doing] = time.monotonic()
            bars.update(tasks[doing], completed=done)

        yield told


def print_table(
    title: str,
    header: Sequence[str],
    rows: Iterable[Iterable[str]],
    left_aligned: bool = False,
) -> None:
    """Print a table to standard output: numbers to the right, or words all to the left."""
    from rich import console, markup, table

    justify: Literal["left", "right"] = "left" if left_aligned else "right"
    columns = (
        table.Column(name, justify=justify if number else "left")
        for number, name in enumerate(header)
    )
    drawn = table.Table(*columns, title=title, title_justify="left")
    for row in rows:
        # a cell is no markup, whatever brackets it has
        drawn.add_row(*map(markup.escape, row))
    screen = console.Console()
    if not screen.is_terminal:
        screen.width = WIDTH_IN_FILES
    screen.print(drawn)


def print_results(
    title: str, rows: Sequence["Row"], pictures: Sequence[Path], folder: Path
) -> None:
    """Print result rows, the paper's numbers beside them, and where pictures and all else are."""
    header = ("arm", "what", "of", "unit", "mean ± over steps", "± over seeds", "paper")
    print_table(title, header, map(_cells, rows))
    modes = {
        row.arm: (row.first_mode_hz, row.damping_ratio)
        for row in rows
        if row.first_mode_hz is not None
    }
    for arm, (frequency, damping) in modes.items():
        print(
            f"{arm}: first bending mode {frequency:.2f} Hz, damping ratio {damping:.2f}"
        )
    for picture in pictures:
        print(f"{KINDS.get(picture.suffix, 'figure')}: {picture}")
    print(f"all of it: {folder}")


def _cells(row: "Row") -> tuple[str, ...]:
    from s2c2a.evaluation.report import pair

    own = pair(row.mean, row.std_steps)
    seeds = "" if row.std_seeds is None else f"± {row.std_seeds:.2f} ({len(row.seeds)})"
    paper = "" if row.paper_mean is None else pair(row.paper_mean, row.paper_std)
    return (
        row.arm,
        f"{row.task}: {row.metric}",
        row.strategy,
        row.unit,
        own,
        seeds,
        paper,
    )
