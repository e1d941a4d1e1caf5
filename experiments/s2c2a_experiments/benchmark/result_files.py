"""Saved results of a benchmark, for another one that need not run them again."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from s2c2a.arm import arm_to_toml
from s2c2a.errors import S2C2AError, counted
from s2c2a.execution.sources import code_digest
from s2c2a.files.json_files import load_json
from s2c2a.files.text import LARGEST, write_atomically
from s2c2a_experiments.benchmark.cells import Cell, Result
from s2c2a_experiments.benchmark.entrants import is_plain
from s2c2a_experiments.benchmark.protocol import VERSION
from s2c2a_experiments.benchmark.scores import Metric

ADVICE = "give the planners.json of a run directory"
DIGITS = 16  # of digests: no two of a million are equal by chance
MAX_BYTES = 20_000_000  # of a file: hundreds of entrants on dozens of arms
SIGNED = {"clearance", "jerk"}
"""Metrics that may be negative."""


def _plain(text: str) -> str:
    if not is_plain(text):
        raise ValueError("write text of one line without backquotes")
    return text


Text = Annotated[str, AfterValidator(_plain)]
"""Text that terminals and tables show as it is; the file may be a stranger's."""
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Time = Annotated[float, Field(ge=0.0, le=LARGEST)]  # zero by a coarse clock


class _Model(BaseModel):
    model_config = ConfigDict(
        extra="forbid", strict=True, allow_inf_nan=False, frozen=True
    )


class SavedResult(_Model):
    """A `Result`, with names in the place of its cell.

    Attributes:
        entrant: its name.
        task: its name.
        arm: its name.
        digest: of what the result depends on, but the code of the project.
        versions: number of its versions in the list of the file.
        step: median and 99th percentile of the times of its control steps [ms], if any.
        failures: messages of runs that an error ended.
        metrics: a value of every run that has one.
    """

    entrant: Text
    task: Text
    arm: Text
    digest: Text
    versions: Annotated[int, Field(ge=0)]
    step: Annotated[list[Time], Field(min_length=2, max_length=2)] | None
    failures: list[Text]
    metrics: dict[Metric, list[Number]]

    @model_validator(mode="after")
    def _check_metrics(self) -> "SavedResult":
        shares = self.metrics.get("success", [])
        if not shares or not all(0.0 <= share <= 1.0 for share in shares):
            raise ValueError("'success' must have a share from 0 to 1 for every run")
        for name, values in self.metrics.items():
            if len(values) > len(shares):
                raise ValueError(f"'{name}' has more values than there are runs")
            if name not in SIGNED and not all(value >= 0.0 for value in values):
                raise ValueError(f"'{name}' has a negative value")
        if len(self.failures) > len(shares):
            raise ValueError("there are more failures than runs")
        return self


class ResultFile(_Model):
    """What `planners.json` holds.

    Attributes:
        protocol: version.
        seeds: of all results.
        versions: of the software of the results, by name.
        results: in any order.
    """

    protocol: int
    seeds: list[int]
    versions: list[dict[Text, Text]]
    results: list[SavedResult]

    @model_validator(mode="after")
    def _check_versions(self) -> "ResultFile":
        for result in self.results:
            if result.versions >= len(self.versions):
                raise ValueError(f"there are no versions {result.versions}")
        return self


def save_results(results: Sequence[Result], seeds: Sequence[int], path: Path) -> None:
    """Write results, each on a line; an existing file is replaced."""
    versions: list[dict[str, str]] = []
    lines = []
    for result in results:
        if result.versions not in versions:
            versions.append(result.versions)
        entrant, task, arm = result.cell.names
        saved = SavedResult(
            entrant=entrant,
            task=task,
            arm=arm,
            digest=_digest(result.cell),
            versions=versions.index(result.versions),
            step=None if result.step is None else list(result.step),
            failures=list(result.failures),
            metrics=result.metrics,
        )
        lines.append(saved.model_dump_json())
    head = {"protocol": VERSION, "seeds": list(seeds), "versions": versions}
    body = ",\n".join(lines)
    text = f'{json.dumps(head)[:-1]}, "results": [\n{body}\n]}}\n'
    write_atomically(text, path)


def _digest(cell: Cell) -> str:
    """Of options, task, arm and the user's code and weights."""
    entrant = cell.entrant
    code = code_digest(entrant.strategy) if entrant.is_own else ""
    code += entrant.weights.file if entrant.weights else ""
    arm = arm_to_toml(entrant.sensed(cell.arm.arm))
    # tasks follow from group and pace
    tasks = cell.task.scenes, cell.arm.group, cell.arm.pace
    parts = (entrant.options, entrant.recipe, code, *tasks, arm)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:DIGITS]


def load_results(
    path: str | Path, cells: Sequence[Cell], seeds: Sequence[int]
) -> tuple[list[Result], int]:
    """Results of these cells in a file, and how many others it holds.

    Args:
        path: a file of `save_results`.
        cells: to look up; a result counts if it was made with the same options, arm and
            user's code.
        seeds: of all results.

    Raises:
        S2C2AError: the file holds no results, those of another protocol or of other
            seeds, or another number of runs than the task has.
    """
    file = load_json(
        ResultFile, path, S2C2AError, "file of benchmark results", ADVICE, MAX_BYTES
    )
    if file.protocol != VERSION:
        raise S2C2AError(
            f"{path} has results of protocol {file.protocol}, and this is protocol "
            f"{VERSION}; leave the file out"
        )
    if file.seeds != list(seeds):
        raise S2C2AError(
            f"{path} has results of seeds {file.seeds}, and {list(seeds)} are asked for; "
            "give the same number to --seeds, or leave the file out"
        )
    known = {(*cell.names, _digest(cell)): cell for cell in cells}
    results = []
    for saved in file.results:
        cell = known.get((saved.entrant, saved.task, saved.arm, saved.digest))
        if not cell:
            continue
        runs = len(saved.metrics["success"])
        if runs != len(seeds) * cell.task.scenes:
            raise S2C2AError(
                f"{path} has {counted(runs, 'run')} of {saved.entrant} with "
                f"{saved.arm}, {saved.task}, and {cell.task.scenes} a seed are asked "
                f"for; {ADVICE}"
            )
        results.append(_result(cell, saved, file.versions[saved.versions]))
    return results, len(file.results) - len(results)


def _result(cell: Cell, saved: SavedResult, versions: dict[str, str]) -> Result:
    step = None
    if saved.step:
        median, slow = saved.step
        step = median, slow
    return Result(cell, saved.metrics, tuple(saved.failures), step, versions)
