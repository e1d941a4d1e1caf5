"""Traces on disk: one NumPy archive with the arm that made them, read without pickle."""

import io
import os
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.files import save_whole
from s2c2a.viz.trace import NUMBERS, Trace, check_same_arm

TRACES = "traces.npz"
COLUMNS = (*NUMBERS, "counted")
MOST_TRACES = 64


def save_traces(traces: Sequence[Trace], arm: ArmSpec, path: str | os.PathLike) -> Path:
    """Write traces of an arm in single precision, times in double.

    Raises:
        S2C2AError: no trace, a trace of another arm, or the file cannot be written.
    """
    check_same_arm(traces, arm)
    arrays = {"arm": np.array(arm_to_toml(arm)), "labels": np.array([trace.label for trace in traces])}
    for number, trace in enumerate(traces):
        for name in COLUMNS:
            values = getattr(trace, name)
            arrays[f"{number}.{name}"] = values if name in ("times", "counted") else values.astype(np.float32)
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    return save_whole(content.getvalue(), path)


def load_traces(path: str | os.PathLike) -> tuple[list[Trace], ArmSpec]:
    """Read traces and their arm.

    Raises:
        S2C2AError: no such file, or it is damaged.
    """
    if not Path(path).is_file():
        raise S2C2AError(f"no traces at {path}; `s2c2a run` and the record button of `s2c2a live` write them")
    try:
        with np.load(path, allow_pickle=False) as file:
            arm = arm_from_toml(str(file["arm"]), f"arm in {path}")
            labels = [str(label) for label in file["labels"][:MOST_TRACES]]
            traces = [
                Trace(label, **{name: file[f"{number}.{name}"] for name in COLUMNS if f"{number}.{name}" in file})
                for number, label in enumerate(labels)
            ]
    except (OSError, KeyError, ValueError, TypeError, IndexError, EOFError, zipfile.BadZipFile) as error:
        raise S2C2AError(f"{path} holds no traces, or is damaged: {error}; run it again") from error
    check_same_arm(traces, arm)
    return traces, arm
