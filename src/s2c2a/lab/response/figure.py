"""Figure of a measured frequency response: gain and phase, measured and expected."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes

from s2c2a.viz.charts import headline, label_log_axis, new_axes, new_figure, save_figure
from s2c2a.viz.colors import colors_by_label

Spectrum = tuple[Float[np.ndarray, " bands"], Complex[np.ndarray, " bands"]]


def response_figure(
    spectra: Mapping[str, Sequence[Spectrum]], path: str | Path, title: str
) -> Path:
    """Draw gain and phase over frequency: measured as points, expected as lines.

    Args:
        spectra: for each direction, the measured and the expected frequencies [Hz] with
            complex gains.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        title: above the axes.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(7.6, 5.6)
    grid = figure.add_gridspec(2, 1)
    gain = new_axes(figure, grid[0], "frequency [Hz]", "gain")
    phase = new_axes(figure, grid[1], "frequency [Hz]", "phase [deg]", sharex=gain)
    points = {"marker": "o", "linestyle": "none"}
    lines = {"linewidth": 1.6, "alpha": 0.7}
    for direction, color in colors_by_label(spectra).items():
        measured, expected = spectra[direction]
        label = f"towards {direction}, measured"
        _draw_spectrum(gain, phase, measured, color=color, label=label, **points)
        label = f"towards {direction}, expected"
        _draw_spectrum(gain, phase, expected, color=color, label=label, **lines)
    label_log_axis(gain)
    label_log_axis(phase)
    gain.set_ylim(bottom=0.0)
    gain.label_outer()
    headline(gain, title)
    return save_figure(figure, path)


def _draw_spectrum(gain: Axes, phase: Axes, spectrum: Spectrum, **style) -> None:
    frequencies, gains = spectrum
    gain.plot(frequencies, np.abs(gains), **style)
    phase.plot(frequencies, np.rad2deg(np.unwrap(np.angle(gains))), **style)
