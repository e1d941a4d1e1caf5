"""Files written whole or not at all."""

import io
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_FORMATS = ("png", "pdf", "svg")
DOTS_PER_INCH = 160


def save_whole(content: bytes, path: str | os.PathLike) -> Path:
    """Write a file beside its place and move it there, so that a reader never sees half of it.

    Missing folders are made; a file of that name is replaced.

    Raises:
        S2C2AError: the file cannot be written.
    """
    path = Path(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise S2C2AError(f"cannot write {path}: {error}; choose a place where you may write") from error
    return path


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
