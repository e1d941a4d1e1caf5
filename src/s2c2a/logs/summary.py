"""What an import found, in words."""

from collections.abc import Iterator

import numpy as np

from s2c2a.logs.importing import Imported


def cable_rows(imported: Imported) -> Iterator[tuple[str, ...]]:
    """A row for every cable: column, module, angle, what larger numbers do, radius if all the gain were in it."""
    layout, errors = imported.layout, imported.fit.errors
    for module, drives in enumerate(layout.drive):
        for cable, drive in enumerate(drives):
            off = np.rad2deg(errors.angles[drive]) if errors else np.nan
            pulls = layout.factor[module, cable] < 0 or imported.arm.actuation == "tension"
            yield (
                imported.names[drive],
                str(module),
                f"{layout.angles_deg[module, cable]:.1f} +- {off:.1f}",
                "pull" if pulls else "release",
                f"{layout.gains[module, cable]:.3f} +- {errors.gains[drive] if errors else np.nan:.3f}",
            )


def summary(imported: Imported) -> list[str]:
    """Lines: episodes, steps, what of the truth is known, residual, doubts."""
    steps = sum(map(len, imported.episodes))
    lines = [
        f"{len(imported.episodes)} episodes of {_range(map(len, imported.episodes))} steps, {steps} in all, of "
        f"{imported.rows} rows" + (f"; {imported.broken} rows were broken and are gaps" if imported.broken else ""),
        f"truth: {_known(imported)}",
        f"frame: ends of the model are {1e3 * imported.residual:.1f} mm (rms) from those seen; cables of outer modules "
        f"{'bend' if imported.motors.coupled else 'do not bend'} inner ones",
        f"base in the log's frame: {_vector(imported.base)} m, x along {_vector(imported.axes[0])}, "
        f"z along {_vector(imported.axes[2])}",
    ]
    return lines + [f"could not be told apart: {doubt}" for doubt in imported.doubts]


def _vector(numbers: np.ndarray) -> str:
    return f"({', '.join(f'{number:.4f}' for number in numbers)})"


def _range(numbers) -> str:
    low, *_, high = sorted([*numbers] * 2)
    return str(low) if low == high else f"{low} to {high}"


def _known(imported: Imported) -> str:
    states = np.concatenate([episode.sensor("states") for episode in imported.episodes])
    known = np.isfinite(states)
    parts = []
    for module in range(states.shape[1]):
        position, axis = known[:, module, :3].all(axis=-1).mean(), known[:, module, 3:].all(axis=-1).mean()
        if position:
            parts.append(f"end of module {module} in {100 * position:.1f} % of steps, its axis in {100 * axis:.1f} %")
    return "; ".join(parts)
