"""What an import found, in words."""

from collections.abc import Iterable, Iterator

import numpy as np

from s2c2a.logs.importing import Again, Imported


def cable_rows(imported: Imported) -> Iterator[tuple[str, ...]]:
    """A row for every cable: column, module, angle, what larger numbers do, radius if all the gain were in it."""
    layout = imported.layout
    errors = imported.fit.errors
    for module, drives in enumerate(layout.drive):
        for cable, drive in enumerate(drives):
            off = np.rad2deg(errors.angles[drive]) if errors else np.nan
            pulls = (
                layout.factor[module, cable] < 0 or imported.arm.actuation == "tension"
            )
            yield (
                imported.rig.names[drive],
                str(module),
                f"{layout.angles_deg[module, cable]:.1f} +- {off:.1f}",
                "pull" if pulls else "release",
                f"{layout.gains[module, cable]:.3f} +- {errors.gains[drive] if errors else np.nan:.3f}",
            )


def summary(imported: Imported) -> list[str]:
    """Lines: episodes, steps, what of the truth is known, residual, doubts."""
    lines = [
        *_read(imported),
        f"frame: ends of the model are {1e3 * imported.residual:.1f} mm (rms) from those seen; cables of outer modules "
        f"{'bend' if imported.motors.coupled else 'do not bend'} inner ones",
        f"base in the log's frame: {_vector(imported.rig.base)} m, x along {_vector(imported.rig.axes[0])}, "
        f"z along {_vector(imported.rig.axes[2])}",
    ]
    return lines + [f"could not be told apart: {doubt}" for doubt in imported.doubts]


def summary_again(again: Again) -> list[str]:
    """The same of another session, and how far the tip is from where it was in the first."""
    said = [*_read(again), "frame and cables: as in the first recording"]
    moved, cables = again.nearby
    if not len(moved):
        return [
            *said,
            "the tip was not seen in both sessions, so whether a camera or a motor moved cannot be told",
        ]
    unit = "N" if again.episodes[0].arm.actuation == "tension" else "mm"
    size = 1e3 if unit == "mm" else 1.0
    return [
        *said,
        f"in the {len(moved)} steps whose cables stood most as they did then, within {size * np.median(cables):.2g} "
        f"{unit} (median), the tip is {1e3 * np.median(np.linalg.norm(moved, axis=-1)):.1f} mm from where it was then "
        f"(median; by {_vector(1e3 * np.median(moved, axis=0), 1)} mm in the base frame): if that is more than cables "
        "remember, a camera or a motor has moved, and this session is better imported by itself",
    ]


def _read(imported: Imported | Again) -> list[str]:
    steps = sum(map(len, imported.episodes))
    broken = (
        f"; {imported.broken} rows were broken and are gaps" if imported.broken else ""
    )
    return [
        f"{len(imported.episodes)} episodes of {_range(map(len, imported.episodes))} steps, {steps} in all, of "
        f"{imported.rows} rows{broken}",
        f"truth: {_known(imported)}",
    ]


def _vector(numbers: Iterable[float], digits: int = 4) -> str:
    return f"({', '.join(f'{number:.{digits}f}' for number in numbers)})"


def _range(numbers) -> str:
    low, *_, high = sorted([*numbers] * 2)
    return str(low) if low == high else f"{low} to {high}"


def _known(imported: Imported | Again) -> str:
    states = np.concatenate([episode.sensor("states") for episode in imported.episodes])
    known = np.isfinite(states)
    parts = []
    for module in range(states.shape[1]):
        position = known[:, module, :3].all(axis=-1).mean()
        axis = known[:, module, 3:].all(axis=-1).mean()
        if position:
            parts.append(
                f"end of module {module} in {100 * position:.1f} % of steps, its axis in {100 * axis:.1f} %"
            )
    return "; ".join(parts)
