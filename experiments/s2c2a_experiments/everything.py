"""Table `everything`: all rows of `results/`, by one state of the sources.

It is made in parts. Each part is one table with its run directory, and is kept once it is
finished, so that parts of an interrupted command add up, and folders of several machines.
"""

import json
import os
import platform
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from s2c2a.cli.execution import ALL_CORES, Work
from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.execution.versions import versions
from s2c2a.files.text import read_text, write_atomically

Table = tuple[str, Callable[..., None]]
MADE = "made.json"
PROJECT = Path("results")
"""Of a clone; times of its parts are the estimate."""
LOGS = Path("examples/data")
REAL: dict[str, tuple[tuple[str, ...], ...]] = {
    "opencr_v4": (("train.csv.gz",), ("val.csv.gz",)),
    "stanford_trunk": (("control_inputs_60s.csv.gz", "observations_60s.csv.gz"),),
}
"""Folder of `LOGS` -> files of each recording; the first one trains."""
ROWS = "*.json", "planners.csv", "by-arm.csv"
"""Files of a run directory that pages show."""
SMOKE: dict[str, dict[str, Any]] = {
    "interaction": {"seeds": 1},
    "stanford_trunk": {},
    "planners": {"smoke": True},
}
"""Parts that take minutes together, and their options: a table of runs, models on a
recording, and planners."""


def everything(
    tables: Mapping[str, Table],
    smoke: bool = False,
    only: Sequence[str] = (),
    work: Work = ALL_CORES,
) -> None:
    """Make all parts that are not finished, and collect their rows in `OUT/results`.

    Args:
        tables: of `s2c2a reproduce`: name -> summary, and what makes it.
        smoke: make the parts of `SMOKE` alone.
        only: names of parts; all by default.
        work: directory (runs/everything or runs/smoke) and parallel execution.

    Raises:
        S2C2AError: there is no such part, or one in the directory was made by other
            sources.
    """
    out = work.out or Path("runs/smoke" if smoke else "runs/everything")
    kept = out / PROJECT
    parts = _parts(tables, out)
    if smoke:
        parts = {
            name: partial(parts.get(name) or tables[name][1], **options)
            for name, options in SMOKE.items()
        }
    for name in only:
        if name not in parts:
            raise S2C2AError(
                f"no part '{name}'{did_you_mean(name, parts)}; choose of "
                f"{', '.join(parts)}"
            )
    sources = versions()["sources"]
    made = {file.parent.name: _read(file) for file in kept.glob(f"*/{MADE}")}
    for name, part in made.items():
        if part["sources"] != sources:
            raise S2C2AError(
                f"'{name}' in {out} was made by other sources ({part['sources']}, now "
                f"{sources}); choose another --out"
            )
    chosen = only or list(parts)
    for number, name in enumerate(chosen, start=1):
        part = made.setdefault(name, {"sources": sources} | _no_time())
        if part["finished"]:
            continue
        known = _read(PROJECT / name / MADE).get("processor_hours")
        took = f"; took {known:.1f} processor hours before" if known else ""
        print(f"part {number} of {len(chosen)}: {name}{took}", flush=True)
        folder = out / "parts" / name
        with _timed(part, kept / name / MADE):
            parts[name](work=replace(work, out=folder))
            _copy_rows(folder, kept / name)
            part["finished"] = True
    hours = sum(part["processor_hours"] for part in made.values())
    print(f"{len(made)} parts in {hours:.1f} processor hours; rows: {kept}")


def _parts(tables: Mapping[str, Table], out: Path) -> dict[str, Callable[..., None]]:
    """Folder of `results/` -> what makes its rows."""
    from s2c2a_experiments.benchmark.command import benchmark
    from s2c2a_experiments.cli import PAPER

    from_files = {"real", "payloads"}
    others = [name for name in tables if name not in {*PAPER, "all", *from_files}]
    _, make_all = tables["all"]
    _, make_real = tables["real"]
    parts: dict[str, Callable[..., None]] = {
        "best": make_all,
        "paper": partial(make_all, recipe="paper"),
    }
    for name in ("paths", *others):
        if name != "everything":
            parts[name] = tables[name][1]
    for name in REAL:
        parts[name] = partial(_real, make_real, name, out)
    return parts | {"planners": benchmark}


def _real(make: Callable[..., None], name: str, out: Path, work: Work) -> None:
    """Import the recordings of a real arm, and compare models on them."""
    from s2c2a.data import load_recording
    from s2c2a.logs import import_logs, import_take, load_map, save_imported

    folder = LOGS / name
    if not folder.is_dir():
        raise S2C2AError(f"{folder} is missing; run the command in a clone of s2c2a")
    log_map = load_map(folder / "map.toml")
    recordings: list[Path] = []
    for number, files in enumerate(REAL[name]):
        recording = out / "recordings" / f"{name}-{number}.episodes"
        logs = [folder / file for file in files]
        recordings.append(recording)
        if recording.exists():
            continue
        recording.parent.mkdir(parents=True, exist_ok=True)
        if number:
            take = import_take(logs, log_map, load_recording(recordings[0]))
            save_imported(take, recording, {})
        else:
            save_imported(import_logs(logs, log_map), recording, {})
    # the rows of recordings are made at once: half of them are not kept
    make(recordings, work=replace(work, overwrite=True))


def _no_time() -> dict[str, Any]:
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    return {"finished": False, "hours": 0.0, "processor_hours": 0.0, "machine": machine}


@contextmanager
def _timed(part: dict[str, Any], file: Path) -> Iterator[None]:
    """Add the time of the block to a part, and save it, however the block ends."""
    start = time.monotonic()
    processor = _processor_time()
    try:
        yield
    finally:
        part["hours"] += (time.monotonic() - start) / 3600.0
        part["processor_hours"] += (_processor_time() - processor) / 3600.0
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(json.dumps(part, indent=1) + "\n", file)


def _processor_time() -> float:
    """Of this process and its finished children [s]."""
    return sum(os.times()[:4])


def _copy_rows(folder: Path, place: Path) -> None:
    place.mkdir(parents=True, exist_ok=True)
    for pattern in ROWS:
        for file in folder.glob(pattern):
            shutil.copy2(file, place)


def _read(path: Path) -> dict[str, Any]:
    return json.loads(read_text(path)) if path.is_file() else {}
