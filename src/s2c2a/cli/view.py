"""`s2c2a view`: runs, a recording, a training or an arm in the browser."""

from pathlib import Path

import tyro

from s2c2a.cli.crews import require
from s2c2a.cli.live import Port, wait_for_interrupt


def view(what: tyro.conf.Positional[tuple[str, ...]], port: Port = 8080) -> None:
    """Look at what is finished, in the scene of `s2c2a live`: runs, a recording, a training, or an arm on its own.

    Args:
        what: run folders to scrub and compare, or a recording ending in .h5, or a strategy ending in .safetensors, or a
            preset or an arm file to bend.
        port: where the page shall be; the next free one if it is taken.
    """
    require("live", "viser", "websockets", "msgspec")
    page = page_of(what, port)
    try:
        print(f"{', '.join(what)}: {page.gate.address}\nControl-C ends it.", flush=True)
        wait_for_interrupt()
    finally:
        page.close()


def page_of(what: tuple[str, ...], port: int):
    """The page for runs, a recording, a training or an arm.

    Raises:
        S2C2AError: nothing, too much or nothing of the kind.
    """
    from s2c2a.arm import load_arm
    from s2c2a.data import load_recording
    from s2c2a.errors import S2C2AError
    from s2c2a.live.viewing import view_arm, view_recording, view_runs, view_training
    from s2c2a.strategies import load_strategy

    if not what:
        raise S2C2AError(
            "say what to look at: run folders, a recording ending in .h5, a strategy ending in .safetensors, or an arm"
        )
    if all(Path(one).is_dir() for one in what):
        traces, arm = _traces_in(what)
        return view_runs(traces, arm, port)
    if len(what) > 1:
        raise S2C2AError(f"{len(what)} things to look at, and not all are run folders; give runs, or one thing alone")
    if what[0].endswith((".h5", ".hdf5")):
        return view_recording(load_recording(what[0]), port)
    if what[0].endswith(".safetensors"):
        return view_training(load_strategy(what[0]), port)
    return view_arm(load_arm(what[0]), port)


def _traces_in(folders: tuple[str, ...]):
    """The traces of all folders, which must be of one arm."""
    from s2c2a.errors import S2C2AError
    from s2c2a.viz.trace_files import TRACES, load_traces

    files = [file for folder in folders for file in sorted(Path(folder).glob(f"*.{TRACES}"))]
    if not files:
        raise S2C2AError(f"no runs in {', '.join(folders)}; `s2c2a run` and recordings of `s2c2a live` write them")
    loaded = [load_traces(file) for file in files]
    arm = loaded[0][1]
    other = next((one for _, one in loaded if not one.same_body(arm)), None)
    if other is not None:
        raise S2C2AError(f"runs of '{arm.name}' and of '{other.name}' cannot be shown as one; give those of one arm")
    return [trace for traces, _ in loaded for trace in traces], arm
