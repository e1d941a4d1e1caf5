"""Keep what the benchmarks measured as rows in `results/performance/`.

`make bench` on an idle machine, then `python -m tools.performance`.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tools import ROOT
from tools.results_tables import RESULTS

MEASURED = ROOT / "runs" / "bench"
FOLDER = RESULTS / "performance"
TAIL = "99 % [ms]"
ASKED = "asked:"


def rows_of(file: Path) -> Iterator[dict[str, Any]]:
    """Times of a file's benchmarks [ms], and what they state beside them."""
    for one in json.loads(file.read_text(encoding="utf-8"))["benchmarks"]:
        beside = dict(one["extra_info"])
        beside.pop(ASKED, None)
        yield {
            "benchmark": f"{file.stem}: {one['name'].removeprefix('test_')}",
            "size": (one["params"] or {}).get("size"),
            "median": 1e3 * one["stats"]["median"],
            "tail": beside.pop(TAIL, None),
            "beside": beside,
        }


def machine_of(files: list[Path]) -> dict[str, Any]:
    """The machine and the sources that all files are of.

    Raises:
        SystemExit: there is no file, or some are of other sources.
    """
    machines = [
        json.loads(file.read_text(encoding="utf-8"))["machine_info"] for file in files
    ]
    sources = {machine["versions"]["sources"] for machine in machines}
    if len(sources) != 1:
        raise SystemExit(
            f"{MEASURED} holds times of {len(sources)} states of the sources; empty it, "
            "and run `make bench` once"
        )
    return {
        "sources": sources.pop(),
        "versions": machines[0]["versions"],
        "processor": machines[0]["cpu"]["brand_raw"],
        "cores": machines[0]["cores"],
        "load": max(machine["load"] for machine in machines),
    }


def main() -> None:
    """Write the rows, and what made them."""
    files = sorted(MEASURED.glob("bench_*.json"))
    machine = machine_of(files)
    rows = [row for file in files for row in rows_of(file)]
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, content in (("times", rows), ("made", machine)):
        text = json.dumps(content, indent=1, default=str) + "\n"
        (FOLDER / f"{name}.json").write_text(text, encoding="utf-8")
    print(f"{len(rows)} rows: {FOLDER}")


if __name__ == "__main__":
    main()
