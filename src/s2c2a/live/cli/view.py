"""Command `s2c2a view`: runs, a recording, a training or an arm in the browser."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.execution import require
from s2c2a.episodes.file import ENDING
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.live.cli.live import Port, wait_for_interrupt

if TYPE_CHECKING:
    from s2c2a.live.window import Window


WEIGHTS = ".safetensors"
Shown = tyro.conf.Positional[
    Annotated[tuple[str, ...], tyro.conf.arg(metavar="RUN|FILE|PRESET ...")]
]


def view(
    what: Shown,
    port: Port = 8080,
) -> None:
    """Show runs, a recording, a training or an arm, in the scene of `s2c2a live`.

    Args:
        what: run directories or files of runs to replay and compare; or a recording
            (both end in .episodes); or a strategy (.safetensors); or a preset or an arm
            file, to bend it.
        port: port of the page; the next free one if it is taken.
    """
    require("live", "viser", "websockets", "msgspec")
    with closing(open_window(what, port)) as window:
        print(f"{', '.join(what)}: {window.gate.address}")
        print("Ctrl-C stops it.", flush=True)
        wait_for_interrupt()


def open_window(what: tuple[str, ...], port: int) -> "Window":
    """Window that shows runs, a recording, a training or an arm.

    Raises:
        S2C2AError: nothing is named, or several things that cannot be shown together.
    """
    from s2c2a.live import viewing
    from s2c2a.strategies import load_networks

    if len(what) == 1 and what[0].endswith(WEIGHTS):
        return viewing.view_training(load_networks(what[0]), port)
    if not what:
        raise S2C2AError(
            "say what to look at: run directories, files of runs "
            f"({ENDING}), a strategy (.safetensors), or an arm"
        )
    if all(Path(name).is_dir() or name.endswith(ENDING) for name in what):
        # window that compares runs, or shows one recording
        from s2c2a import data, episodes, viz
        from s2c2a.runtime.step_writer import PIECES, joined

        files = _episode_files(what)
        loaded = [episodes.load_episodes(file) for file in files]
        # only recordings have this option
        if len(files) == 1 and "babbling" in loaded[0][1]:
            return viewing.view_recording(data.load_recording(files[0]).episodes, port)
        traces = []
        for file, (runs, options) in zip(files, loaded, strict=True):
            if options.get(PIECES):  # of a killed process
                runs = [joined(runs)]
            for run in runs:
                label = f"{_run_label(run.options)} · {file.parent.name}"
                traces.append(viz.Trace(run, label))
        arms = [run.arm for runs, _ in loaded for run in runs]
        for other in arms:
            if other.differences(arms[0]):
                raise S2C2AError(
                    f"runs of '{arms[0].name}' and of '{other.name}' cannot be shown "
                    "together; give those of one arm"
                )
        return viewing.view_runs(traces, arms[0], port)
    if len(what) > 1:
        raise S2C2AError(
            f"{len(what)} names, and not all are runs; give runs, or a single name"
        )
    try:
        return viewing.view_arm(load_arm(what[0]), port)
    except ArmError as error:
        raise S2C2AError(
            f"'{what[0]}' is no arm that can be shown ({error}); give a preset, an arm "
            f"file, a run directory, a recording ({ENDING}) or a strategy ({WEIGHTS})"
        ) from error


def _episode_files(what: tuple[str, ...]) -> list[Path]:
    files = []
    for path in map(Path, what):
        files += sorted(path.glob(f"*{ENDING}")) if path.is_dir() else [path]
    if not files:
        raise S2C2AError(
            f"no runs in {', '.join(what)}; `s2c2a run` and recordings of `s2c2a live` "
            "write them"
        )
    return files


def _run_label(options: Any) -> str:
    values = [options.get(name) for name in ("strategy", "task", "seed")]
    return " ".join(str(value) for value in values if value is not None)
