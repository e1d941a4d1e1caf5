"""The figure of a report: how times grow."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from s2c2a.bench.measurement import Growth
from s2c2a.viz.growth_figure import GrowthCurve, growth_figure


def draw_growths(growths: Sequence[Growth], path: Path) -> Path:
    """Draw growths over logarithmic axes, which have no place for a size of zero."""
    return growth_figure([_curve(growth) for growth in growths], path)


def _curve(growth: Growth) -> GrowthCurve:
    sizes = np.array(growth.sizes, dtype=float)
    there = sizes > 0
    medians, tails = np.array(growth.medians)[there], np.array(growth.percentiles_99)[there]
    return GrowthCurve(growth.of, growth.what, sizes[there], medians, tails, growth.slope)
