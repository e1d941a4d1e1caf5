"""Results of a benchmark in a file: of which another one takes what it need not run."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import ConfigDict, TypeAdapter, ValidationError

from s2c2a.errors import S2C2AError
from s2c2a.files import MAX_BYTES, read_text, write_atomically
from s2c2a.user_code import code_digest
from s2c2a_experiments.benchmark.cells import Cell, Result
from s2c2a_experiments.benchmark.entrants import Entrant
from s2c2a_experiments.benchmark.protocol import VERSION


@dataclass(frozen=True)
class SavedResult:
    """A `Result`, with its cell by names.

    Attributes:
        entrant: name.
        options: digest of the entrant's options, and of the user's code.
        task: name.
        arm: name.
        versions: place of its versions in the file's list.
        step: as in `Result`.
        failures: as in `Result`.
        figures: as in `Result`.
    """

    entrant: str
    options: str
    task: str
    arm: str
    versions: int
    step: tuple[float, float] | None
    failures: tuple[str, ...]
    figures: dict[str, list[float]]

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True)
class _File:
    protocol: int
    seeds: tuple[int, ...]
    versions: tuple[dict[str, str], ...]
    results: tuple[SavedResult, ...]

    __pydantic_config__ = ConfigDict(extra="forbid")


def save_results(results: Sequence[Result], seeds: Sequence[int], path: Path) -> None:
    """Write results, each on a line; an existing file is replaced."""
    versions = []
    lines = []
    for result in results:
        if result.versions not in versions:
            versions.append(result.versions)
        saved = _saved(result, versions.index(result.versions))
        lines.append(json.dumps(asdict(saved)))
    text = "".join(
        [
            f'{{"protocol": {VERSION},\n"seeds": {json.dumps(seeds)},\n',
            f'"versions": {json.dumps(versions)},\n"results": [\n',
            ",\n".join(lines),
            "\n]}\n",
        ]
    )
    write_atomically(text, path)


def _saved(result: Result, versions: int) -> SavedResult:
    entrant, task, arm = result.cell.names
    return SavedResult(
        entrant,
        _digest(result.cell.entrant),
        task,
        arm,
        versions,
        result.step,
        result.failures,
        result.figures,
    )


def _digest(entrant: Entrant) -> str:
    """Of options, and of the user's code; the project's has a version."""
    code = code_digest(entrant.strategy) if entrant.is_own else ""
    content = repr((entrant.strategy, entrant.recipe, code))
    return hashlib.sha256(content.encode()).hexdigest()[:8]


def load_results(
    path: str | Path, cells: Sequence[Cell], seeds: Sequence[int]
) -> list[Result]:
    """Results of these cells in a file; what else it holds is left out.

    Args:
        path: a file of `save_results`.
        cells: whose entrants have the same options as those of the file.
        seeds: of all results.

    Raises:
        S2C2AError: the file is not one of this protocol and these seeds.
    """
    file = _read(path)
    if file.seeds != tuple(seeds):
        raise S2C2AError(
            f"{path} has results of seeds {file.seeds}, and {tuple(seeds)} are asked; "
            "give the same number to --seeds, or leave the file out"
        )
    known = {cell.names: cell for cell in cells}
    digests = {cell.entrant.name: _digest(cell.entrant) for cell in cells}
    results = []
    for saved in file.results:
        cell = known.get((saved.entrant, saved.task, saved.arm))
        if cell and digests[saved.entrant] == saved.options:
            versions = file.versions[saved.versions]
            results.append(
                Result(cell, saved.figures, saved.failures, saved.step, versions)
            )
    return results


def _read(path: str | Path) -> _File:
    try:
        file = TypeAdapter(_File).validate_json(read_text(path, most=MAX_BYTES))
        _check(file)
    except (S2C2AError, ValidationError) as error:
        raise S2C2AError(
            f"{path} does not hold results of this benchmark: {error}; take the "
            "planners.json of a run directory"
        ) from error
    return file


def _check(file: _File) -> None:
    if file.protocol != VERSION:
        raise S2C2AError(f"its protocol is {file.protocol}, not {VERSION}")
    for result in file.results:
        if not 0 <= result.versions < len(file.versions):
            raise S2C2AError(f"there are no versions {result.versions}")
        if not result.figures.get("success"):
            raise S2C2AError(f"a result of {result.entrant} has no success")
