"""Compare rows that were made now with those in `results/`.

`python -m tools.compare_results runs/smoke/results` prints the rows that differ from
those of the same metric by more than their spread over seeds, and fails if there are any,
or if nothing is compared.
What has other rows, such as shorter tasks of planners, is not compared.
"""

import json
import sys
from pathlib import Path
from typing import Any

from tools.results_tables import RESULTS

NAMES = "experiment", "task", "arm", "fidelity", "strategy", "recipe", "metric"
SPREADS = 4.0  # standard deviations over seeds: three or five of them estimate it badly
SHARE = 0.2  # of a mean without a spread: processors round differently


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
        allowed = SPREADS * spread if spread else SHARE * abs(old["mean"])
        if new["unit"] != "ms" and not abs(new["mean"] - old["mean"]) <= allowed:
            values = f"{old['mean']:.3g} before, {new['mean']:.3g} now {new['unit']}"
            lines.append(f"{', '.join(names)}: {values} (allowed {allowed:.2g})")
    return sorted(lines)


def main() -> None:
    """Compare each folder of a folder with `results/`."""
    before = load_rows(RESULTS)
    differ = False
    compared = 0
    for folder in sorted(path for path in Path(sys.argv[1]).iterdir() if path.is_dir()):
        now = load_rows(folder)
        lines = differing(now, before)
        count = len(now.keys() & before.keys())
        print("\n".join([f"{folder.name}: {count} rows compared", *lines]))
        differ |= bool(lines)
        compared += count
    sys.exit(differ or not compared)


if __name__ == "__main__":
    main()
