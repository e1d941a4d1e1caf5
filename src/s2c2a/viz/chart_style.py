"""How charts look: one place for type, lines and frames."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine

from s2c2a.viz.colours import FAINT, INK, MUTED


def new_figure(width: float, height: float) -> Figure:
    """A white figure, width and height in inches, that lays its axes out by itself."""
    layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06, wspace=0.03, hspace=0.03)
    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def new_axes(figure: Figure, place: SubplotSpec, x_label: str, y_label: str, **options) -> Axes:
    """Axes with a light grid and no box."""
    axes = figure.add_subplot(place, **options)
    axes.set_xlabel(x_label, color=INK, fontsize=9)
    axes.set_ylabel(y_label, color=INK, fontsize=9)
    axes.tick_params(colors=MUTED, labelsize=8, length=3)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in axes.spines:
        axes.spines[side].set(visible=side in ("left", "bottom"), color="#b9c1cb")
    return axes


def headline(axes: Axes, text: str) -> None:
    """A small bold title at the left edge; a name from a user is shown as it is, not read as mathematics."""
    axes.set_title(text, loc="left", fontsize=9.5, fontweight="bold", color=INK, parse_math=False)


def legend(owner: Axes | Figure, axes: Axes, **options) -> None:
    """A legend without a frame that names what is drawn in `axes`, if anything has a name."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        shown = owner.legend(handles, labels, frameon=False, fontsize=8.5, labelcolor=INK, **options)
        for text in shown.get_texts():
            text.set_parse_math(False)
