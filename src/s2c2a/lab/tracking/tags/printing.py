"""Sheets of paper with tags and boards to scale, as PDF or PNG."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from s2c2a.errors import did_you_mean
from s2c2a.files.text import atomic_write
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tags.calibration import board_picture
from s2c2a.lab.tracking.tags.camera import Board
from s2c2a.lab.tracking.tags.detection import tag_dictionary
from s2c2a.lab.tracking.tags.layout import CELLS, SHEET, Tag, TagLayout
from s2c2a.lab.tracking.tags.opencv import cv2

PAPERS = {
    "a4": (0.297, 0.210),
    "a3": (0.420, 0.297),
    "letter": (0.2794, 0.2159),
}
"""Width and height of a sheet, landscape [m]."""
DPI = 600  # of PNG files
MARGIN = 0.010  # m; that printers leave white
CAPTION = 0.006  # m; for the text above a tag
GAP = 0.004  # m; between rows
RULER = 0.100  # m
RULER_HEIGHT = 0.016  # m; at the lower edge of a sheet
INCH = 0.0254  # m
CAPTION_HEIGHT = 0.0035  # m
_CELL_PIXELS = 32  # so that no viewer smooths the cells
_FORMATS = (".pdf", ".png")
_ADVICE = "Print at 100 %, not fitted to the page; this ruler is 100 mm long"


class PrintError(TrackingError):
    """A sheet cannot be printed."""


@dataclass(frozen=True)
class PlacedTag:
    """A tag on a sheet.

    Attributes:
        tag: to print.
        left: edge of its paper [m].
        bottom: edge of its paper [m].
        side: of its paper [m].
    """

    tag: Tag
    left: float
    bottom: float
    side: float


def print_tags(
    layout: TagLayout, path: Path, paper: str = "a4", side: float = 0.0
) -> list[Path]:
    """Write the sheets of all tags, body by body.

    The papers of a row touch, so that a row of four folds to a collar.

    Args:
        layout: of the tags.
        path: PDF, or PNG; several sheets of a PNG get numbers.
        paper: "a4", "a3" or "letter".
        side: of the paper of a tag [m], such as the width of a collar; by default tag
            and white margin.

    Returns:
        The files.

    Raises:
        PrintError: a tag does not fit the paper, or the file cannot be written.
    """
    pages = place_tags(layout, _paper(paper), side)
    figures = (_tag_figure(page, _paper(paper)) for page in pages)
    return _save(figures, len(pages), path)


def print_board(board: Board, path: Path, paper: str = "a4") -> list[Path]:
    """Write the sheet of a calibration board.

    Args:
        board: to print.
        path: PDF or PNG.
        paper: "a4", "a3" or "letter".

    Returns:
        The files.

    Raises:
        PrintError: the board does not fit the paper, or the file cannot be written.
    """
    width, height = _paper(paper)
    board_width = board.columns * board.square
    board_height = board.rows * board.square
    bottom = RULER_HEIGHT + (height - RULER_HEIGHT - board_height) / 2
    left = (width - board_width) / 2
    if left < MARGIN / 2 or bottom < RULER_HEIGHT:
        raise PrintError(
            f"a board of {1000 * board_width:.0f} x {1000 * board_height:.0f} mm does "
            f"not fit {paper}; take smaller or fewer squares, or larger paper "
            f"({', '.join(PAPERS)})"
        )
    figure, axes = _sheet((width, height))
    picture = board_picture(board, 200)[200:-200, 200:-200]
    _draw(axes, picture, left, bottom, board_width, board_height)
    return _save(iter([figure]), 1, path)


def place_tags(
    layout: TagLayout, paper: tuple[float, float], side: float = 0.0
) -> list[list[PlacedTag]]:
    """Arrange the tags of a layout on sheets.

    Args:
        layout: of the tags.
        paper: width and height [m].
        side: of the paper of a tag [m]; by default tag and white margin.

    Raises:
        PrintError: a tag does not fit.
    """
    pages: list[list[PlacedTag]] = [[]]
    top = paper[1] - MARGIN
    for row in _rows(layout, paper[0] - 2 * MARGIN, side):
        height = max(_side(tag, side) for tag in row)
        if top - CAPTION - height < RULER_HEIGHT:
            top = paper[1] - MARGIN
            if pages[-1]:
                pages.append([])
        bottom = top - CAPTION - height
        if bottom < RULER_HEIGHT:
            raise _too_large(height)
        left = MARGIN
        for tag in row:
            pages[-1].append(PlacedTag(tag, left, bottom, _side(tag, side)))
            left += _side(tag, side)
        top = bottom - GAP
    return pages


def _rows(layout: TagLayout, width: float, side: float) -> Iterator[list[Tag]]:
    """Tags of one body each, as many as fit side by side."""
    for body in layout.bodies:
        row: list[Tag] = []
        used = 0.0
        for tag in layout.tags:
            if tag.body != body:
                continue
            if _side(tag, side) > width:
                raise _too_large(_side(tag, side))
            # four make a collar
            if used + _side(tag, side) > width or len(row) == 4:
                yield row
                row = []
                used = 0.0
            row.append(tag)
            used += _side(tag, side)
        yield row


def _side(tag: Tag, side: float) -> float:
    return max(side, SHEET * tag.size)


def _too_large(side: float) -> PrintError:
    return PrintError(
        f"a tag on {1000 * side:.0f} mm of paper does not fit; take smaller tags or "
        f"larger paper ({', '.join(PAPERS)})"
    )


def _paper(name: str) -> tuple[float, float]:
    if name not in PAPERS:
        raise PrintError(
            f"paper '{name}'{did_you_mean(name, PAPERS)}; "
            f"choose one of {', '.join(PAPERS)}"
        )
    return PAPERS[name]


def _tag_figure(page: Sequence[PlacedTag], paper: tuple[float, float]) -> Figure:
    figure, axes = _sheet(paper)
    for placed in page:
        tag = placed.tag
        side = placed.side
        outline = Rectangle(
            (placed.left, placed.bottom),
            side,
            side,
            fill=False,
            linewidth=0.3,
            linestyle=(0, (8, 8)),
            edgecolor="0.6",
        )
        axes.add_patch(outline)
        margin = (side - tag.size) / 2
        cells = cv2.aruco.generateImageMarker(tag_dictionary(), tag.id, CELLS)
        picture = np.kron(cells, np.ones((_CELL_PIXELS, _CELL_PIXELS), np.uint8))
        left = placed.left + margin
        bottom = placed.bottom + margin
        _draw(axes, picture, left, bottom, tag.size, tag.size)
        _draw_caption(axes, placed, margin)
    return figure


def _draw_caption(axes: Axes, placed: PlacedTag, margin: float) -> None:
    """Write name and upper edge where the cut leaves them, if the margin has room."""
    tag = placed.tag
    text = f"{tag.label}  up: this edge  {1000 * tag.size:g} mm"
    middle = placed.left + placed.side / 2
    edge = placed.bottom + placed.side
    # the tag needs a white margin of a cell
    is_inside = margin - tag.size / CELLS > CAPTION_HEIGHT
    height = edge - 0.001 if is_inside else edge + 0.001
    axes.text(
        middle,
        height,
        text,
        fontsize=6,
        ha="center",
        va="top" if is_inside else "bottom",
    )


def _draw(
    axes: Axes,
    picture: np.ndarray,
    left: float,
    bottom: float,
    width: float,
    height: float,
) -> None:
    extent = (left, left + width, bottom, bottom + height)
    axes.imshow(
        picture, cmap="gray", vmin=0, vmax=255, extent=extent, interpolation="none"
    )


def _sheet(paper: tuple[float, float]) -> tuple[Figure, Axes]:
    """A page whose axes are meters, with a ruler."""
    width, height = paper
    figure = Figure(figsize=(width / INCH, height / INCH), dpi=DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    bottom = 0.008
    axes.plot([MARGIN, MARGIN + RULER], [bottom, bottom], color="black", linewidth=0.4)
    for millimeters in range(0, 101, 5):
        position = MARGIN + millimeters / 1000
        tick = 0.004 if millimeters % 10 == 0 else 0.002
        line = [bottom, bottom + tick]
        axes.plot([position, position], line, color="black", linewidth=0.4)
    axes.text(MARGIN + RULER + 0.004, bottom, _ADVICE, fontsize=8)
    axes.set_autoscale_on(False)
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    return figure, axes


def _save(figures: Iterator[Figure], count: int, path: Path) -> list[Path]:
    if path.suffix.lower() not in _FORMATS:
        raise PrintError(f"{path} is neither PDF nor PNG; name the file .pdf or .png")
    if path.suffix.lower() == ".pdf":
        metadata = {"CreationDate": None}  # the same tags give the same file
        with (
            atomic_write(path, PrintError) as temporary,
            PdfPages(temporary, metadata=metadata) as pdf,
        ):
            for figure in figures:
                pdf.savefig(figure)
        return [path]
    names = [path]
    if count > 1:
        names = [path.with_stem(f"{path.stem}-{page + 1}") for page in range(count)]
    for figure, name in zip(figures, names, strict=True):
        with atomic_write(name, PrintError) as temporary:
            figure.savefig(temporary, format="png", dpi=DPI)
    return names
