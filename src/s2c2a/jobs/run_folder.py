"""One folder a run: options, versions, results, figures, replay page."""

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from s2c2a.episodes import save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError
from s2c2a.evaluation.report import Row, save_csv, save_rows
from s2c2a.files import holds, save_whole
from s2c2a.jobs.job import Run
from s2c2a.versions import versions
from s2c2a.viz import Trace, replay_page, run_figure
from s2c2a.viz.video import save_video

MARKER = "options.json"


def open_run_folder(
    path: Path | None, label: str, options: dict, overwrite: bool, go_on: bool = False
) -> Path:
    """Make a run folder and write down its options and versions; a name with the time if no path is given.

    With `go_on`, a folder that was begun with the same options and versions is opened
    as it is; without a path it has no time in its name, so that it is found again.

    Raises:
        S2C2AError: the folder holds something and `overwrite` was not asked for, or it
            is no run folder.
    """
    folder = path or Path("runs") / (
        label if go_on else f"{datetime.now():%Y%m%d-%H%M%S}-{label}"
    )
    text = (
        json.dumps({"options": options, "versions": versions()}, indent=1, default=str)
        + "\n"
    )
    marker = folder / MARKER
    if go_on and not overwrite and marker.is_file() and holds(marker, text):
        return folder
    if folder.is_symlink() and overwrite:
        raise S2C2AError(
            f"{folder} is a link and is left alone; name the folder itself"
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        if not overwrite:
            raise S2C2AError(
                f"{folder} exists and is not empty; say --overwrite or choose another --out"
            )
        if not marker.is_file():
            raise S2C2AError(
                f"{folder} is no run folder: it holds no {MARKER}; it is left alone, choose another --out"
            )
        aside = folder.with_name(f".{folder.name}.old-{os.getpid()}")
        # whole or gone: a kill never leaves half a run folder in its place
        folder.rename(aside)
        shutil.rmtree(aside)
    save_whole(text, marker)
    return folder


def save_results(folder: Path, rows: Sequence[Row], runs: Sequence[Run]) -> None:
    """Write `results.json` and `metrics.csv`, every score of every step."""
    save_rows(rows, folder / "results.json")
    header = (
        "task",
        "strategy",
        "seed",
        "step",
        "time_s",
        "metric",
        "value",
        "tick_ms",
    )
    save_csv(
        header, (line for run in runs for line in _steps(run)), folder / "metrics.csv"
    )


def _steps(run: Run) -> Iterator[tuple]:
    times = run.episode.times()
    ticks = run.episode.ran("tick_time")
    for scored in run.scores:
        for step, (time, value, tick) in enumerate(
            zip(times, scored.values, ticks, strict=True)
        ):
            name = (
                run.task,
                run.strategy,
                run.seed,
                step,
                f"{time:.3f}",
                scored.score.metric,
            )
            yield (*name, f"{value:.4f}", f"{1e3 * tick:.4f}")


def draw_runs(folder: Path, runs: Sequence[Run], video: bool = False) -> list[Path]:
    """Draw the first seed's runs of one arm: a figure, a replay page, and, if asked for, a video of the first run.

    Returns:
        These files, none where nobody watched the arm. The episodes go beside them.
    """
    first = [run for run in runs if run.seed == runs[0].seed]
    traces = [trace_of(run) for run in first if "states" in run.episode.sensors]
    job = first[0].job
    title = f"{first[0].task} with {job.arm.name}"
    summary = {
        "recipe": job.recipe.name,
        "simulation": job.conditions.fidelity,
        "seed": str(job.seed),
    }
    save_episodes(
        [run.episode for run in first], folder / f"{job.arm.name}{ENDING}", summary
    )
    if not traces:  # nobody watched
        return []
    figure = run_figure(traces, job.arm, folder / f"{job.arm.name}.png", title)
    page = replay_page(traces, job.arm, title, folder / f"{job.arm.name}.html", summary)
    return [
        figure,
        page,
        *([save_video(traces[0], job.arm, folder / job.arm.name)] if video else ()),
    ]


def trace_of(run: Run, label: str | None = None) -> Trace:
    """What viz draws of a run, under the strategy's name unless another is given."""
    trace = Trace(run.episode, label or run.strategy)
    followed = (
        trace.followed_module,
        trace.followed_module - trace.episode.arm.module_count,
    )
    scores = run.job.task.scores
    of_it = (
        score.steps
        for score in scores
        if score.metric == "position" and score.module in followed
    )
    return replace(trace, counted=next(of_it, None))
