"""Runs on disk: one NumPy archive each, read without pickle."""

import zipfile
from pathlib import Path

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.evaluation.rollout import COLUMNS, Rollout
from s2c2a.files import written_whole
from s2c2a.tasks import Task


def save_rollout(run: Rollout, path: Path) -> None:
    """Write a run, in single precision; the file appears whole or not at all."""
    arrays = {name: getattr(run, name) for name in (*COLUMNS, "centre_lines")}
    known = {name: value.astype(np.float32) for name, value in arrays.items() if value is not None}
    try:
        with written_whole(path) as part, open(part, "wb") as file:
            np.savez_compressed(file, strategy=np.array(run.strategy), **known)
    except OSError as error:
        raise S2C2AError(f"{path} cannot be written: {error}") from error


def load_rollout(path: Path, task: Task) -> Rollout | None:
    """Read a run of a task, or None where there is none, it is damaged, or it is not of as many steps."""
    try:
        with np.load(path, allow_pickle=False) as file:
            columns = {name: file[name] for name in COLUMNS}
            watched = file["centre_lines"] if "centre_lines" in file.files else None
            strategy = str(file["strategy"])
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    if any(len(column) != len(task.goals) for column in columns.values()):
        return None
    return Rollout(task, strategy, **columns, centre_lines=watched)
