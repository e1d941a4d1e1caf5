"""Runs in the viewer of Rerun."""

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.evaluation.rollout import OnStep
from s2c2a.files.text import cannot_write, check_replaceable
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.rerun_scene import RerunScene, layout, save_to
from s2c2a.integrations.streams.background import shown_in_background

HOST = "127.0.0.1"
ENDING = ".rrd"
"""Of the files that are replaced."""
START_TIME = 1.0  # s; a viewer without a screen ends before


@contextmanager
def rerun_stream(
    arm: ArmSpec, url: str = "", file: str = "", overwrite: bool = False
) -> Iterator[OnStep]:
    """Show steps in a viewer that is started here, unless `url` or `file` is given.

    Args:
        arm: that is controlled.
        url: of a viewer that runs, such as rerun+http://127.0.0.1:9876/proxy.
        file: where to write a recording instead, such as run.rrd.
        overwrite: replace the file if it exists.

    Raises:
        S2C2AError: the extra `rerun` is missing, options contradict, there is no viewer,
            or the file exists or cannot be written.
    """
    with needs_extra("rerun", "--stream rerun"):
        import rerun  # noqa: PLC0415  # an extra
    if url and file:
        raise S2C2AError("--stream rerun has both url and file; leave one out")
    if overwrite and not file:
        raise S2C2AError(
            "--stream rerun has overwrite and no file to replace; add file=run.rrd, or "
            "leave it out"
        )
    stream = rerun.RecordingStream("s2c2a")
    if file:
        _save(stream, Path(file), overwrite)
    else:
        _connect(stream, url)
    print(f"stream: Rerun, {file or url or 'a viewer of its own'}")
    entities = RerunScene(arm, stream)
    try:
        with shown_in_background(arm, entities.log_step) as on_step:
            yield on_step
    finally:
        stream.disconnect()


def _save(stream: Any, file: Path, overwrite: bool) -> None:
    """Write steps to a file while they happen: an interrupted run keeps its own.

    Raises:
        S2C2AError: it exists and is not to be replaced, or it cannot be written.
    """
    if os.path.lexists(file) and not overwrite:
        raise S2C2AError(
            f"{file} exists; replace it (--stream rerun,file={file},overwrite=true), or "
            "choose another name"
        )
    check_replaceable(file, ENDING)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        save_to(stream, file)
    except OSError as error:
        raise S2C2AError(cannot_write(file, file, error)) from error


def _connect(stream: Any, url: str) -> None:
    try:
        if url:
            stream.connect_grpc(url, default_blueprint=layout())
        else:
            _show_on_this_machine(stream)
    except (RuntimeError, ValueError, OSError) as error:
        reason = str(error).partition("\n")[0].rstrip(".")
        raise S2C2AError(
            f"no viewer of Rerun can be opened: {reason}; start one with `rerun`, and "
            "add its address (--stream rerun,url=rerun+http://127.0.0.1:9876/proxy), or "
            "write a file (--stream rerun,file=run.rrd)"
        ) from error


def _show_on_this_machine(stream: Any) -> None:
    """Start a viewer that listens on 127.0.0.1; that of `spawn` listens everywhere.

    Raises:
        OSError: there is no viewer, or it ends at once.
    """
    beside = Path(sys.executable).with_name("rerun")
    program = shutil.which("rerun") or shutil.which(beside)
    if program is None:
        raise FileNotFoundError("the program rerun is missing")
    with socket.socket() as free:
        free.bind((HOST, 0))
        port = free.getsockname()[1]
    viewer = subprocess.Popen(
        [program, "--bind", HOST, "--port", str(port)], stderr=subprocess.DEVNULL
    )
    try:
        code = viewer.wait(START_TIME)
    except subprocess.TimeoutExpired:
        address = f"rerun+http://{HOST}:{port}/proxy"
        stream.connect_grpc(address, default_blueprint=layout())
    else:
        raise OSError(f"the viewer ended at once, with code {code}; is there a screen?")
