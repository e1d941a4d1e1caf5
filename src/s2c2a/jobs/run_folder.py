"""The run directory: options, versions, results, figures, replay page."""

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from s2c2a.episodes import save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError, listed
from s2c2a.evaluation.report import Row, save_csv, save_rows
from s2c2a.execution.versions import versions
from s2c2a.files.text import keep_manifest, read_text, unlisted_files, write_atomically
from s2c2a.jobs.job import Job, Run
from s2c2a.printing import differences
from s2c2a.viz import Trace, replay_page, run_figure

MARKER = "options.json"


def open_run_directory(
    path: Path | None, label: str, options: dict, overwrite: bool, resume: bool = False
) -> Path:
    """Open a run directory, and write its options and versions.

    A manifest lists the files that the command writes there; only such files are ever
    deleted.

    Args:
        path: of the directory; a new one under runs/ if None.
        label: names a new one, after the time.
        options: to write.
        overwrite: replace an existing run directory, if it holds nothing but the files
            of its manifest.
        resume: resume a run: open a directory with the same options and versions as it
            is, and leave the time out of the name, so that the next call finds it.

    Returns:
        The directory.

    Raises:
        S2C2AError: the directory is not empty and `overwrite` is not set, is a link, or
            holds other files.
    """
    folder = path
    if folder is None:
        name = label if resume else f"{datetime.now():%Y%m%d-%H%M%S}-{label}"
        folder = Path("runs") / name
    content = {"options": options, "versions": versions()}
    text = json.dumps(content, indent=1, default=str) + "\n"
    marker = folder / MARKER
    fault = "is not empty"
    if resume and not overwrite and marker.is_file():
        changes = _changes(marker, json.loads(text))
        fault = changes and f"is of other options or versions ({changes})"
    if fault:
        _clear(folder, overwrite, fault)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        keep_manifest(folder)
    except OSError as error:
        raise S2C2AError(
            f"cannot make the run directory {folder}: {error}; choose another --out"
        ) from error
    if fault:
        write_atomically(text, marker)
    return folder


def _changes(marker: Path, content: dict) -> str:
    """Options and versions that differ from those of a run directory; empty for none."""
    try:
        return listed(differences(json.loads(read_text(marker)), content), "; ")
    except (ValueError, RecursionError):
        return f"{marker.name} is damaged"


def _clear(folder: Path, overwrite: bool, fault: str) -> None:
    """Delete a run directory if it exists and may be replaced."""
    if folder.is_symlink() and overwrite:
        raise S2C2AError(f"{folder} is a link; give the directory itself")
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not overwrite:
        raise S2C2AError(
            f"{folder} exists and {fault}; add --overwrite or choose another --out"
        )
    if not folder.is_dir():
        raise S2C2AError(f"{folder} is a file; choose another --out")
    others = unlisted_files(folder)
    if others:
        raise S2C2AError(
            f"{folder} holds {listed(others)}, which no run of this package wrote there; "
            "--overwrite deletes the files of a run only: move the others away, or "
            "choose another --out"
        )
    # renamed first, so that an interruption never leaves half a run directory
    aside = folder.with_name(f".{folder.name}.old-{os.getpid()}")
    try:
        folder.rename(aside)
        if unlisted_files(aside):  # written meanwhile
            aside.rename(folder)
            raise OSError("something is written there now")
        shutil.rmtree(aside)
    except OSError as error:
        raise S2C2AError(
            f"{folder} cannot be replaced: {error}; choose another --out"
        ) from error


METRICS_HEADER = (
    "task",
    "strategy",
    "seed",
    "step",
    "time_s",
    "metric",
    "value",
    "tick_ms",
)


def save_results(folder: Path, rows: Sequence[Row], runs: Sequence[Run]) -> None:
    """Write `results.json`, and `metrics.csv` with the scores of every step.

    Args:
        folder: the run directory.
        rows: for `results.json`.
        runs: for `metrics.csv`.
    """
    save_rows(rows, folder / "results.json")

    def lines() -> Iterator[tuple]:
        for run in runs:
            times = run.episode.times()
            ticks = run.episode.ran("tick_time")
            names = (run.task, run.strategy, run.seed)
            for scored in run.scores:
                metric = scored.score.metric
                samples = zip(times, scored.values, ticks, strict=True)
                for step, (time, value, tick) in enumerate(samples):
                    numbers = (f"{value:.4f}", f"{1e3 * tick:.4f}")
                    yield (*names, step, f"{time:.3f}", metric, *numbers)

    save_csv(METRICS_HEADER, lines(), folder / "metrics.csv")


def draw_runs(folder: Path, runs: Sequence[Run]) -> list[Path]:
    """Draw the first seed's runs of one arm, and save their episodes.

    Args:
        folder: the run directory.
        runs: of one arm.

    Returns:
        The figure and the replay page; nothing without recorded states.
    """
    first = [run for run in runs if run.seed == runs[0].seed]
    job = first[0].job
    arm = job.arm
    summary = summary_of(job)
    episodes = [run.episode for run in first]
    save_episodes(episodes, folder / f"{arm.name}{ENDING}", summary)
    traces = [trace_of(run) for run in first if "states" in run.episode.sensors]
    if not traces:
        return []
    title = f"{first[0].task} with {arm.name}"
    return [
        run_figure(traces, arm, folder / f"{arm.name}.png", title),
        replay_page(traces, arm, title, folder / f"{arm.name}.html", summary),
    ]


def summary_of(job: Job) -> dict[str, str]:
    """Names and values that a replay page shows of a job."""
    robot = "simulation" if job.conditions.robot.simulated else "robot"
    return {
        "recipe": job.recipe.name,
        robot: job.conditions.fidelity,
        "seed": str(job.seed),
    }


def trace_of(run: Run) -> Trace:
    """The trace of a run, for figures."""
    trace = Trace(run.episode, run.strategy)
    module = trace.followed_module
    # a score counts modules from the base or, with negative numbers, from the end
    followed = (module, module - trace.episode.arm.module_count)
    for score in run.job.task.scores:
        if score.metric == "position" and score.module in followed:
            return replace(trace, counted=score.steps)
    return replace(trace, counted=None)
