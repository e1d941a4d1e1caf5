"""How far marker jumps tilt the base frame that `s2c2a import` identifies.

`python benchmarks/marker_jumps.py` imports two logs of real arms, in which a share of the
rows has one end off by 300 mm in a random direction, and compares the frames with those
of the clean logs. It takes a few minutes.
"""

import csv
import gzip
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from s2c2a.logs.log_map import load_map
from s2c2a.logs.pipeline import Imported, import_logs

DATA = Path(__file__).parent.parent / "examples" / "data"
JUMP = 0.3  # m
SHARES = 3 / 4730, 30 / 4730, 300 / 4730


class Log(NamedTuple):
    """A log of a real arm.

    Attributes:
        folder: its folder in `DATA`.
        before: files that the map joins before the one with the ends.
        file: with the ends.
        ends: columns of the position of each end.
        unit: of positions [m].
    """

    folder: str
    before: tuple[str, ...]
    file: str
    ends: tuple[tuple[str, str, str], ...]
    unit: float


LOGS = (
    Log("opencr_v4", (), "train.csv.gz", (("tip_x", "tip_y", "tip_z"),), 1e-3),
    Log(
        "stanford_trunk",
        ("control_inputs_60s.csv.gz",),
        "observations_60s.csv.gz",
        (("x1", "y1", "z1"), ("x2", "y2", "z2"), ("x3", "y3", "z3")),
        1.0,
    ),
)


def main() -> None:
    """Print the angle and the distance between the frames with and without jumps."""
    with tempfile.TemporaryDirectory() as folder:
        damaged = Path(folder) / "damaged.csv"
        for log in LOGS:
            clean = _import(log, DATA / log.folder / log.file)
            for share in SHARES:
                count = _write_with_jumps(log, damaged, share)
                angle, distance = _difference(clean, _import(log, damaged))
                print(
                    f"{log.folder}, {count} jumps: {angle:.3f} deg, "
                    f"{1e3 * distance:.1f} mm",
                    flush=True,
                )


def _import(log: Log, path: Path) -> Imported:
    folder = DATA / log.folder
    paths = [*(folder / name for name in log.before), path]
    return import_logs(paths, load_map(folder / "map.toml"))


def _write_with_jumps(log: Log, path: Path, share: float) -> int:
    """Write the log with jumps of one end in a share of the rows, and count them."""
    with gzip.open(DATA / log.folder / log.file, "rt") as file:
        rows = list(csv.DictReader(file))
    random = np.random.default_rng(0)
    count = round(share * len(rows))
    for row in random.choice(len(rows), count, replace=False):
        direction = random.normal(size=3)
        jump = JUMP / log.unit * direction / np.linalg.norm(direction)
        end = log.ends[random.integers(len(log.ends))]
        for column, change in zip(end, jump, strict=True):
            rows[row][column] = str(float(rows[row][column]) + float(change))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return count


def _difference(first: Imported, second: Imported) -> tuple[float, float]:
    """Angle [deg] and distance [m] between two base frames."""
    rotation = np.array(first.rig.axes) @ np.array(second.rig.axes).T
    cosine = np.clip((np.trace(rotation) - 1) / 2, -1, 1)
    shift = np.subtract(first.rig.base, second.rig.base)
    return float(np.degrees(np.arccos(cosine))), float(np.linalg.norm(shift))


if __name__ == "__main__":
    main()
