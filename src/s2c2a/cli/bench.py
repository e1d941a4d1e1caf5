"""`s2c2a bench`: how fast it is here."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from s2c2a.cli.console import Arm, print_table, progress_bar

if TYPE_CHECKING:
    from s2c2a.bench.options import BenchOptions
    from s2c2a.bench.parts import Part
    from s2c2a.bench.report import Report

PartName = Literal[
    "startup", "plan", "batch", "step", "profile", "jitter", "collect", "training", "simulation", "rods", "growth"
]
QUIET_LOAD = 0.5
Parts = tyro.conf.Positional[Annotated[tuple[PartName, ...], tyro.conf.arg(metavar="[PART ...]")]]


def bench(
    parts: Parts = (),
    arm: Arm = "twin_arm",
    seed: int = 0,
    repeats: int = 1000,
    long_repeats: int = 5,
    ticks: int = 10_000,
    memory_ticks: int = 100_000,
    device: Literal["cpu", "gpu"] = "cpu",
    quick: bool = False,
    whole_torch: bool = False,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Time everything here: medians, 99th percentiles, and ratios within one run. Leave the machine alone meanwhile.

    Args:
        parts: which parts; all if none is named (docs/benchmarks.md says what each measures).
        arm: a preset or an arm file.
        seed: of data, networks and whatever else is random.
        repeats: of what takes milliseconds.
        long_repeats: of what takes seconds.
        ticks: at 100 Hz with a real clock.
        memory_ticks: while memory is watched.
        device: that JAX computes on; a GPU suits the parts batch and training.
        quick: a twentieth of all repeats and ticks, few sizes, few epochs: a look, not a result.
        whole_torch: let PyTorch train as many epochs as we do, instead of one for every call of ours.
        out: the run folder; one with the time in its name if not stated.
        overwrite: replace the run folder if it exists.
    """
    from s2c2a.arm import load_arm
    from s2c2a.bench.figure import draw_growths
    from s2c2a.bench.lines import options_to_json
    from s2c2a.bench.options import BenchOptions
    from s2c2a.bench.report import Report
    from s2c2a.bench.runner import chosen
    from s2c2a.experiments.run_folder import open_run_folder

    options = BenchOptions(load_arm(arm), seed, repeats, long_repeats, ticks, memory_ticks, device, whole=whole_torch)
    options = options.quicker() if quick else options
    wanted = chosen(parts)
    folder = open_run_folder(out, "bench", options_to_json(options) | {"parts": parts}, overwrite)
    report = Report(folder / "bench.json", options)
    if report.load > QUIET_LOAD:
        print(f"this machine is busy (load {report.load:.1f}): times will be too long, and limits missed for it")
    for part in wanted:
        _measure(part, options, report)
    if report.growths():
        print(f"figure: {draw_growths(report.growths(), folder / 'growth.png')}")
    _sum_up(report)


def _measure(part: "Part", options: "BenchOptions", report: "Report") -> None:
    """Measure one part, then print its table, whatever ended it."""
    from s2c2a.bench.runner import lines_of
    from s2c2a.bench.table import HEADER, table_rows

    section = report.begin(part)
    try:
        with progress_bar() as progress:
            for line in lines_of(part, options, progress):
                report.add(part, line)
    finally:
        title = f"{part.name}: {part.about} ({part.cores} core(s))"
        print_table(title, HEADER, table_rows(section.lines))
        print(f"kept in {report.path}")


def _sum_up(report: "Report") -> None:
    """What missed its limit, and what failed; a failure is the command's."""
    if missed := report.missed():
        print("missed: " + "; ".join(missed))
    if failed := report.failed():
        print(f"failed: {', '.join(failed)}; the message stands in the table")
        sys.exit(1)
