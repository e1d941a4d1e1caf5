"""Figures on disk."""

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

from s2c2a.errors import S2C2AError
from s2c2a.files import save_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_FORMATS = ("png", "pdf", "svg")
DOTS_PER_INCH = 160


def save_figure(figure: "Figure", path: str | os.PathLike) -> Path:
    """Write a figure in the format that the file's name ends in: png, pdf or svg.

    Raises:
        S2C2AError: the name ends in something else, or the file cannot be written.
    """
    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in FIGURE_FORMATS:
        raise S2C2AError(f"{path}: a figure's name ends in .{', .'.join(FIGURE_FORMATS)}, not in '.{ending}'")
    content = io.BytesIO()
    figure.savefig(content, format=ending, dpi=DOTS_PER_INCH)
    return save_whole(content.getvalue(), path)
