"""`s2c2a view`: runs, a recording, a training or an arm in the browser."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import ModelName
from s2c2a.cli.live import Port, wait_for_interrupt
from s2c2a.cli.execution import require
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.live.window import Window


def view(
    what: tyro.conf.Positional[tuple[str, ...]],
    port: Port = 8080,
    model: ModelName = None,
) -> None:
    """Look at what is finished, in the scene of `s2c2a live`: runs, a recording, a training, or an arm on its own.

    Args:
        what: run folders or files of runs to scrub and compare, or a recording (both
            end in .episodes), or a strategy ending in .safetensors, or a preset or an
            arm file to bend.
        port: where the page shall be; the next free one if it is taken.
        model: the class of a forward model of your own that a strategy file names.
    """
    require("live", "viser", "websockets", "msgspec")
    from s2c2a.models.registry import model_named

    if model:
        model_named(model)
    with closing(window_on(what, port)) as window:
        print(
            f"{', '.join(what)}: {window.gate.address}\nControl-C ends it.", flush=True
        )
        wait_for_interrupt()


def window_on(what: tuple[str, ...], port: int) -> "Window":
    """The window on runs, a recording, a training or an arm.

    Raises:
        S2C2AError: nothing, too much or nothing of the kind.
    """
    from s2c2a.live import viewing
    from s2c2a.strategies import load_strategy

    if not what:
        raise S2C2AError(
            f"say what to look at: run folders, files of runs ({ENDING}), a strategy (.safetensors), an arm"
        )
    if all(Path(one).is_dir() or one.endswith(ENDING) for one in what):
        return _window_on_episodes(what, port)
    if len(what) > 1:
        raise S2C2AError(
            f"{len(what)} things to look at, and not all are runs; give runs, or one thing alone"
        )
    if what[0].endswith(".safetensors"):
        return viewing.view_training(load_strategy(what[0]), port)
    return viewing.view_arm(load_arm(what[0]), port)


def _window_on_episodes(what: tuple[str, ...], port: int) -> "Window":
    """Runs side by side, or a recording: one file that says how it was collected."""
    from s2c2a import data, episodes, viz
    from s2c2a.live import viewing

    files = [
        file
        for one in map(Path, what)
        for file in (sorted(one.glob(f"*{ENDING}")) if one.is_dir() else [one])
    ]
    if not files:
        raise S2C2AError(
            f"no runs in {', '.join(what)}; `s2c2a run` and recordings of `s2c2a live` write them"
        )
    loaded = [episodes.load_episodes(file) for file in files]
    if len(files) == 1 and "babbling" in loaded[0][1]:
        return viewing.view_recording(data.load_recording(files[0]).episodes, port)
    runs = [
        (run, file.parent.name)
        for file, (every, _) in zip(files, loaded, strict=True)
        for run in every
    ]
    first = runs[0][0].arm
    if other := next(
        (run.arm for run, _ in runs if not run.arm.same_mechanics(first)), None
    ):
        raise S2C2AError(
            f"runs of '{first.name}' and of '{other.name}' cannot be shown as one; give those of one arm"
        )
    return viewing.view_runs(
        [viz.Trace(run, f"{_said_of(run.options)} · {folder}") for run, folder in runs],
        first,
        port,
    )


def _said_of(options: Any) -> str:
    said = [options.get(name) for name in ("strategy", "task", "seed")]
    return " ".join(str(word) for word in said if word is not None)
