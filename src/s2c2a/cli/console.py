"""Console output of the commands: progress bars and tables; types of their options."""

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from s2c2a.data import Recording
    from s2c2a.evaluation.report import Row
    from s2c2a.execution.progress import Progress
    from s2c2a.strategies import TrainedNetworks

_ARM = "a preset or an arm file."
Arm = Annotated[str, tyro.conf.arg(metavar="PRESET|FILE", help=_ARM)]
OptionalArm = Annotated[str | None, tyro.conf.arg(metavar="PRESET|FILE")]
_STRATEGY = "s2c2a|pcc|pcc-fitted|s2c2a-motor|FILE.py:Class"
StrategyName = Annotated[str, tyro.conf.arg(metavar=_STRATEGY)]
StrategyNames = Annotated[tuple[str, ...], tyro.conf.arg(metavar=f"{_STRATEGY} ...")]
FidelityName = Annotated[
    Literal["fast", "accurate"], tyro.conf.arg(help="of the simulation.")
]
_RECIPE = tyro.conf.arg(metavar="best|best-long|paper|FILE")
RecipeName = Annotated[str, _RECIPE]
OptionalRecipe = Annotated[str | None, _RECIPE]
Events = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="EVENT")
]
GuardName = Literal["tip", "arm"]
File = tyro.conf.Positional[
    Annotated[str, tyro.conf.arg(metavar="NAME|FILE", help=_ARM)]
]

GivenPath = tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="FILE")]]
OptionalFile = tyro.conf.Positional[
    Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE")]
]
OptionalPath = Annotated[Path | None, tyro.conf.arg(metavar="PATH")]
Count = Annotated[int | None, tyro.conf.arg(metavar="INT")]
OptionalNumber = Annotated[float | None, tyro.conf.arg(metavar="FLOAT")]
SceneFile = Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")]
Vector = Annotated[tuple[float, ...], tyro.conf.arg(metavar="X Y Z")]
"""Three numbers, as `Goal` checks; none where the option is not given."""

WIDTH_IN_FILES = 120  # characters; no table of results needs more
LINE_INTERVAL = 20.0  # s; three lines of progress a minute in a file


@contextmanager
def progress_bar() -> Iterator["Progress"]:
    """Yield a progress callback that shows one bar for each piece of work.

    Where the output is no terminal, it prints a line every `LINE_INTERVAL`.
    """
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
        last_lines: dict[str, float] = {}

        def on_progress(work: str, done: int, total: int) -> None:
            if work not in tasks:
                tasks[work] = bars.add_task(work, total=total)
            bars.update(tasks[work], completed=done, total=total)
            now = time.monotonic()
            shown = last_lines.get(work, -math.inf)
            if not screen.is_terminal and now > shown + LINE_INTERVAL:
                state = f": {done} of {total}" if work in last_lines else " ..."
                screen.print(f"{work}{state}", highlight=False)
                last_lines[work] = now

        yield on_progress


def print_table(
    title: str,
    header: Sequence[str],
    rows: Iterable[Iterable[str]],
    left_aligned: bool = False,
) -> None:
    """Print a table to standard output.

    Columns after the first are right-aligned for numbers, or left-aligned for text.
    """
    from rich import console, markup, table

    justify: Literal["left", "right"] = "left" if left_aligned else "right"
    # brackets, as of units, are no markup
    output = table.Table(title=markup.escape(title), title_justify="left")
    for number, name in enumerate(header):
        output.add_column(markup.escape(name), justify=justify if number else "left")
    for row in rows:
        output.add_row(*map(markup.escape, row))
    screen = console.Console()
    if not screen.is_terminal:
        screen.width = WIDTH_IN_FILES
    screen.print(output)


def print_results(
    title: str, rows: Sequence["Row"], pictures: Sequence[Path], folder: Path
) -> None:
    """Print result rows, the paper's numbers if it has any, and the paths of outputs."""
    from s2c2a.evaluation.report import pair

    header = ["arm", "metric", "strategy", "unit", "mean ± over steps", "± over seeds"]
    cells = []
    for row in rows:
        seeds = ""
        if row.std_seeds is not None:
            seeds = f"± {row.std_seeds:.2f} ({len(row.seeds)})"
        paper = ""
        if row.paper_mean is not None:
            paper = pair(row.paper_mean, row.paper_std)
        metric = f"{row.task}: {row.metric}"
        mean = pair(row.mean, row.std_steps)
        cells.append((row.arm, metric, row.strategy, row.unit, mean, seeds, paper))
    if any(row.paper_mean is not None for row in rows):
        header.append("paper")
    # the paper's numbers come last
    print_table(title, header, [row[: len(header)] for row in cells])
    for picture in pictures:
        label = "replay" if picture.suffix == ".html" else "figure"
        print(f"{label}: {picture}")
    print(f"run directory: {folder}")


def print_held_out_errors(title: str, networks: "TrainedNetworks") -> None:
    """Print the error of each network in percent of the full range.

    What is fitted without held-out samples has none, nor the modal model
    (`evaluation.describe_modal_model`): both are `Fixed`.
    """
    from s2c2a.training.fit import is_fixed

    errors = [
        (name, "{:.2f} ± {:.2f} %".format(*result.percent))
        for name, result in networks.trained.items()
        if not is_fixed(result.network)
    ]
    if errors:
        print_table(title, ("network", "error"), errors)


def draw_coverage(recording: "Recording", out: Path) -> Path | None:
    """Draw the coverage of a recording beside its file.

    Returns:
        Path of the figure, or None if the recording lacks a sensor of configurations.

    Raises:
        S2C2AError: the figure cannot be written.
    """
    from s2c2a import viz
    from s2c2a.errors import ReadingError

    try:
        return viz.coverage_figure(recording.episodes, Path(f"{out}.coverage.png"))
    except ReadingError:  # such as true configurations without tracking
        return None
