"""Compare rows that were made now with those in `results/`.

`python -m tools.compare_results runs/smoke/results` prints the rows that differ from
those of the same metric by more than their spread over seeds, and fails if there are any.
"""

import json
import sys
from pathlib import Path
from typing import Any

from tools import ROOT
from tools.results_tables import RESULTS

NAMES = "experiment", "task", "arm", "fidelity", "strategy", "recipe", "metric"
SPREADS = 4.0  # standard deviations over seeds: three or five of them estimate it badly
SHARE = 0.2  # of a mean that has no spread: processors round differently


def load_rows(folder: Path) -> dict[tuple[str, ...], dict[str, Any]]:
    """Names of a row -> the row, of all files of a folder that hold rows."""
    rows = {}
    for file in sorted(folder.rglob("*.json")):
        content = json.loads(file.read_text(encoding="utf-8"))
        if isinstance(content, list):
            for row in content:
                if NAMES[-1] in row:
                    rows[tuple(row[name] for name in NAMES)] = row
    return rows


def differing(
    now: dict[tuple[str, ...], dict[str, Any]],
    before: dict[tuple[str, ...], dict[str, Any]],
) -> list[str]:
    """Lines on the rows that differ by more than their spread; times are not compared."""
    lines = []
    for names in now.keys() & before.keys():
        new, old = now[names], before[names]
        spread = old["std_seeds"]
        allowed = SHARE * abs(old["mean"]) if spread is None else SPREADS * spread
        if new["unit"] != "ms" and not abs(new["mean"] - old["mean"]) <= allowed:
            values = f"{old['mean']:.3g} before, {new['mean']:.3g} now {new['unit']}"
            lines.append(f"{', '.join(names)}: {values} (allowed {allowed:.2g})")
    return sorted(lines)


def main() -> None:
    """Compare a folder with `results/`."""
    now = load_rows(Path(sys.argv[1]))
    before = load_rows(RESULTS)
    common = len(now.keys() & before.keys())
    lines = differing(now, before)
    print("\n".join(lines))
    print(
        f"{common} rows compared with {RESULTS.relative_to(ROOT)}/, {len(lines)} differ"
    )
    if lines or not common:
        sys.exit(1)


if __name__ == "__main__":
    main()
