"""Figure of a measured response: gain and phase over frequency, measured and expected."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, ScalarFormatter

from s2c2a.viz.charts import headline, new_axes, new_figure, save_figure
from s2c2a.viz.colors import colors_by_label

Spectrum = tuple[Float[np.ndarray, " bands"], Complex[np.ndarray, " bands"]]
TICKS = np.outer([0.01, 0.1, 1.0, 10.0, 100.0], [1.0, 2.0, 5.0]).ravel()


def response_figure(
    spectra: Mapping[str, Sequence[Spectrum]], path: str | Path, title: str
) -> Path:
    """Draw what came over what was asked for: measured as points, expected as lines.

    Args:
        spectra: by direction, measured and expected: frequencies [Hz], and gains with
            their phases.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        title: above it.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(7.6, 5.6)
    grid = figure.add_gridspec(2, 1)
    gain = new_axes(figure, grid[0], "frequency [Hz]", "gain")
    phase = new_axes(figure, grid[1], "frequency [Hz]", "phase [deg]", sharex=gain)
    for towards, color in colors_by_label(spectra).items():
        measured, expected = spectra[towards]
        _draw(
            gain,
            phase,
            measured,
            marker="o",
            linestyle="none",
            color=color,
            label=f"towards {towards}, measured",
        )
        _draw(
            gain,
            phase,
            expected,
            linewidth=1.6,
            color=color,
            alpha=0.7,
            label=f"towards {towards}, expected",
        )
    for axes in (gain, phase):
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_minor_formatter(NullFormatter())
    low, high = gain.get_xlim()
    gain.set_xticks([tick for tick in TICKS if low <= tick <= high])
    gain.set_ylim(bottom=0.0)
    gain.label_outer()
    headline(gain, title)
    return save_figure(figure, path)


def _draw(gain: Axes, phase: Axes, one: Spectrum, **look) -> None:
    frequencies, gains = one
    gain.plot(frequencies, np.abs(gains), **look)
    phase.plot(frequencies, np.rad2deg(np.unwrap(np.angle(gains))), **look)
