"""Command `s2c2a benchmark`: every planner on the same arms and tasks."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.cli.console import Count, print_table, progress_bar
from s2c2a.cli.execution import ALL_CORES, Work, make_executor, run_directory
from s2c2a.errors import S2C2AError, counted, did_you_mean
from s2c2a.files.text import write_atomically

if TYPE_CHECKING:
    from collections.abc import Sequence

    from s2c2a_experiments.benchmark.cells import Cell, Result
    from s2c2a_experiments.benchmark.entrants import Entrant
    from s2c2a_experiments.benchmark.protocol import BenchmarkArm, BenchmarkTask
    from s2c2a_experiments.benchmark.results import PlannerComparison

Names = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")]
Arms = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME|FILE ...")]
Entries = Annotated[tuple[str, ...], tyro.conf.arg(metavar="FILE.py:Class ...")]
WeightFiles = Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE ...")]
Files = Annotated[tuple[str, ...], tyro.conf.arg(metavar="FILE ...")]
SEEDS = 3
SMOKE_SEEDS = 1
SMOKE = ("path", "obstacles")
"""Tasks of the smoke version."""
MAX_TASKS = 2  # that a table in the terminal has columns for


def benchmark(
    entry: Entries = (),
    weights: WeightFiles = (),
    only: Names = (),
    task: Names = (),
    arm: Arms = (),
    seeds: Count = None,
    smoke: bool = False,
    tune: bool = False,
    results: Files = (),
    work: Work = ALL_CORES,
) -> None:
    """Compare planners: all of the paper's Table I, and your own.

    Repeat the command to continue an interrupted run. A run directory keeps all finished
    runs, and the tables of the last command; of the next one, what is finished is not run
    again. The whole benchmark takes hours; --smoke shows in minutes that an entry runs.

    Args:
        entry: your own strategies, by name or file.py:Class, with options behind commas.
        weights: files of networks of the entries, for the arm of each file; without, an
            entry is trained as its recipe says.
        only: these of the project's entrants; "none" for your entries alone.
        task: these tasks of the protocol alone.
        arm: these arms of the protocol alone, or of yours, by file or preset.
        seeds: number of seeds, from zero; 3 by default, 1 with --smoke.
        smoke: one arm, two short tasks, one seed, and of the project's entrants those
            without training, one of each file.
        tune: tune the entrants instead, each by the same number of trials, and write
            tuned.toml.
        results: files planners.json of other benchmarks, such as the project's; what they
            hold is not run again.
        work: run directory (runs/benchmark by default) and parallel execution.
    """
    if tune:
        if entry or weights or task or arm or seeds is not None or smoke or results:
            raise S2C2AError(
                "--tune tunes the project's entrants by its own tasks, arm and seed; "
                "leave out --entry, --weights, --task, --arm, --seeds, --smoke and --results"
            )
        _tune(_entrants((), (), only), work)
        return
    if smoke and results:
        raise S2C2AError("--smoke has shorter tasks than other results; leave out one")
    chosen = _choice(entry, weights, only, task, arm, seeds, smoke)
    _show(*_compare(chosen, results, work))


@dataclass(frozen=True)
class _Choice:
    """What is compared: entrants on tasks with arms, once a seed."""

    entrants: "list[Entrant]"
    tasks: "list[BenchmarkTask]"
    arms: "list[BenchmarkArm]"
    seeds: tuple[int, ...]
    smoke: bool

    def described(self) -> str:
        """All of it as JSON."""
        entrants = [
            (each.name, each.strategy, each.recipe.name) for each in self.entrants
        ]
        content = {
            "entrants": entrants,
            "tasks": [each.name for each in self.tasks],
            "arms": [each.arm.name for each in self.arms],
            "seeds": self.seeds,
        }
        return json.dumps(content, indent=1) + "\n"


def _choice(
    entry: "Sequence[str]",
    weights: "Sequence[Path]",
    only: "Sequence[str]",
    task: "Sequence[str]",
    arm: "Sequence[str]",
    seeds: int | None,
    smoke: bool,
) -> _Choice:
    """What the user asks for.

    Raises:
        S2C2AError: a name is not known or appears twice, or nothing is left.
    """
    from s2c2a import jobs
    from s2c2a_experiments.benchmark import protocol

    entrants = _entrants(entry, weights, only)
    tasks = _chosen(task, protocol.TASKS, "task")
    arms = chosen_arms(arm, smoke)
    count = seeds
    if count is None:
        count = SMOKE_SEEDS if smoke else SEEDS
    if smoke:
        entrants = [each for each in entrants if each.is_own or not each.samples]
        if not only:
            entrants = one_of_each_file(entrants)
        tasks = [replace(each, scenes=1) for each in tasks if each.name in SMOKE]
    if not entrants:
        raise S2C2AError("--smoke leaves out entrants with training; give others")
    compared = {each.arm.name for each in arms}
    for each in entrants:
        if each.weights and compared.isdisjoint(each.arms):
            raise S2C2AError(
                f"the networks of {each.name} are for the arm {', '.join(each.arms)}, and "
                f"--arm has {', '.join(sorted(compared))}; add the preset or file of that "
                "arm to --arm"
            )
    if not tasks:
        raise S2C2AError(f"--smoke has the tasks {' and '.join(SMOKE)}; give these")
    return _Choice(entrants, tasks, arms, tuple(jobs.checked_seeds(0, count)), smoke)


def _compare(
    chosen: _Choice, results: "Sequence[str]", work: Work
) -> "tuple[PlannerComparison, Path]":
    """Make what no file of results holds; return the comparison and its directory."""
    from s2c2a_experiments.benchmark.cells import all_cells, run_cells
    from s2c2a_experiments.benchmark.protocol import VERSION
    from s2c2a_experiments.benchmark.results import PlannerComparison

    cells = all_cells(chosen.entrants, chosen.tasks, chosen.arms)
    dashes = [cell for cell in cells if cell.dash]
    running = [cell for cell in cells if not cell.dash]
    saved = _saved_results(results, running, chosen.seeds)
    label = "benchmark-smoke" if chosen.smoke else "benchmark"
    # runs are found by all that they depend on: other commands may use the same directory
    with run_directory(
        label, {"protocol": VERSION}, work, resume=True, keep_errors=True
    ) as (directory, make):
        try:
            found = run_cells(running, chosen.seeds, make, saved)
        except KeyboardInterrupt:
            print(
                f"finished runs are kept in {directory}; repeat the command to continue"
            )
            raise
        write_atomically(chosen.described(), directory / "compared.json")
    return PlannerComparison(chosen.entrants, found, dashes, chosen.seeds), directory


def _tune(named: "Sequence[Entrant]", work: Work) -> None:
    """Tune entrants as their files have them, and write the values found."""
    from s2c2a import jobs
    from s2c2a.jobs.run_folder import open_run_directory
    from s2c2a_experiments.benchmark import entrants, tune
    from s2c2a_experiments.benchmark.protocol import VERSION

    names = {each.name for each in named if each.tuned}
    if not names:
        raise S2C2AError("none of these entrants is tuned; give others to --only")
    chosen = [each for each in entrants.untuned() if each.name in names]
    options = {
        "protocol": VERSION,
        "trials": tune.TRIALS,
        "entrants": {each.name: tune.described(each) for each in chosen},
    }
    with make_executor(work.jobs, work.cluster) as executor, progress_bar() as progress:
        directory = open_run_directory(
            work.out, "benchmark-tuning", options, work.overwrite, resume=True
        )
        path = directory / "tuned.toml"
        cache = jobs.Cache(runs_in=directory / "runs")

        def keep(values: dict) -> None:
            tune.write_values(values, path)

        tune.tune(chosen, cache, executor, progress, keep)
    print(f"tuned values: {path} (they belong to {entrants.TUNED})")


def _saved_results(
    files: "Sequence[str]", cells: "Sequence[Cell]", seeds: "Sequence[int]"
) -> "list[Result]":
    """Results in files; prints how many of each count, and what made them."""
    from s2c2a_experiments.benchmark.result_files import load_results

    saved = []
    for file in files:
        results, others = load_results(file, cells, seeds)
        saved += results
        makers = dict.fromkeys(
            f"s2c2a {result.versions.get('s2c2a')}" for result in results
        )
        made = f", made with {' and '.join(makers)}" if results else ""
        print(f"{file}: {counted(len(results), 'result')}{made}")
        if others:
            print(
                f"  {others} left out: not asked for, or made with other options, "
                "arms, tasks or code of an entry"
            )
    return saved


def _show(comparison: "PlannerComparison", directory: Path) -> None:
    """Write tables and figure, and print the table."""
    from s2c2a_experiments.benchmark.results import (
        draw,
        failure_lines,
        header,
        lines,
        write_tables,
    )

    table = write_tables(comparison, directory)
    figure = draw(comparison, directory / "planners.png")
    head = header(comparison)
    left_out = {"family"}  # for want of width
    if len(comparison.tasks) > MAX_TASKS:
        left_out |= set(comparison.tasks)
    shown = [number for number, name in enumerate(head) if name not in left_out]

    def narrow(cells: list[str]) -> tuple[str, ...]:
        return tuple(cells[number] for number in shown)

    print_table("planners", narrow(head), map(narrow, lines(comparison)))
    for text in failure_lines(comparison):
        print(text)
    print(f"table: {table} (.csv, .json next to it; by task: cells.csv)")
    print(f"figure: {figure}")


def _entrants(
    entry: "Sequence[str]", weights: "Sequence[Path]", only: "Sequence[str]"
) -> "list[Entrant]":
    from s2c2a_experiments.benchmark.entrants import (
        entrant_of,
        entrants,
        with_weights,
    )

    known = {each.name: each for each in entrants()}
    chosen = [] if only == ("none",) else _chosen(only, known, "entrant")
    own = with_weights([entrant_of(text) for text in entry], weights)
    names = [each.name for each in [*chosen, *own]]
    if not names:
        raise S2C2AError("no entrant; give --entry file.py:Class")
    _check_names(names, "entrants", "name your class otherwise, or leave one out")
    return [*chosen, *own]


def _check_names(names: "Sequence[str]", kind: str, remedy: str) -> None:
    """Raise an error if a name occurs twice: tables tell their lines apart by it."""
    for name in names:
        if names.count(name) > 1:
            raise S2C2AError(f"two {kind} are named '{name}'; {remedy}")


def one_of_each_file(entrants: "Sequence[Entrant]") -> "list[Entrant]":
    """The user's own, and the first of each file of the others."""
    others = [each for each in reversed(entrants) if not each.is_own]
    chosen = {type(each.options).__module__: each.name for each in others}
    names = chosen.values()
    return [each for each in entrants if each.is_own or each.name in names]


def chosen_arms(names: "Sequence[str]", smoke: bool) -> "list[BenchmarkArm]":
    """Arms of the protocol by name, the user's by file or preset; all without names.

    Raises:
        S2C2AError: there is none of this name, a file holds none, or two have one name.
    """
    from s2c2a.arm import load_arm, preset_names
    from s2c2a_experiments.benchmark.protocol import BenchmarkArm, protocol_arms

    arms = {each.arm.name: each for each in protocol_arms()}
    if smoke and not names:
        return [next(iter(arms.values()))]
    presets = [name for name in preset_names() if name not in arms]
    for name in names:
        is_file = name not in arms and (Path(name).suffix or Path(name).is_file())
        if is_file or name in presets:
            arms[name] = BenchmarkArm(load_arm(name), "yours")
    if not names:
        return list(arms.values())
    chosen = _chosen(names, dict.fromkeys(presets) | arms, "arm")
    _check_names(
        [each.arm.name for each in chosen], "arms", "change the name in a file"
    )
    return chosen


def _chosen(names: "Sequence[str]", known: dict, kind: str) -> list:
    """The named ones, or all without names.

    Raises:
        S2C2AError: there is none of this name.
    """
    for name in names:
        if name not in known:
            raise S2C2AError(
                f"no {kind} '{name}'{did_you_mean(name, known)}; choose among "
                f"{', '.join(known)}"
            )
    return [known[name] for name in dict.fromkeys(names)] or list(known.values())
