"""Commands `s2c2a tracking`: calibration of trackers; webcam and tags."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from tyro.extras import SubcommandApp

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, OptionalNumber, OptionalPath, progress_bar
from s2c2a.cli.dependent_options import effective
from s2c2a.errors import S2C2AError, counted
from s2c2a.lab.cli.tracking_calibration import frames, latency

if TYPE_CHECKING:
    from s2c2a.lab.tracking.tags import Board

app = SubcommandApp()
command = app, "Calibrate a pose tracker or a camera; print tags and the board."
app.command(latency)
app.command(frames)
PaperName = Literal["a4", "a3", "letter"]
Device = Annotated[str, tyro.conf.arg(metavar="NUMBER|/dev/videoN|VIDEO|FOLDER")]
WALL = 0.005  # m; between the cables of a module and its collar


@app.command(name="print-tags")
def print_tags(
    arm: Arm = "twin_arm",
    out: Path = Path("tags.pdf"),
    layout: Path = Path("tags.json"),
    size: float = 40.0,
    width: OptionalNumber = None,
    tip_only: bool = False,
    paper: PaperName = "a4",
) -> None:
    """Print tags to scale, and write where they are mounted.

    Every body gets a collar: four tags in a row, folded around it. Print at 100 % and
    measure the ruler.

    Args:
        out: PDF or PNG (600 dpi) to write.
        layout: file of the tags' places to write, for the tracker.
        size: side of the black squares [mm].
        width: outer width of the collars [mm]; by default 10 mm wider than the cables.
        tip_only: tags for the base and the tip only.
        paper: sheet, landscape.
    """
    from s2c2a.lab.tracking.tags import TagLayout, save_layout
    from s2c2a.lab.tracking.tags.layout import SHEET
    from s2c2a.lab.tracking.tags.printing import print_tags

    spec = load_arm(arm)
    _check_length(size, "--size")
    if width is not None:
        _check_length(width, "--width")
    cables = 2 * (max(module.cable_radius for module in spec.modules) + WALL)
    least = max(cables, SHEET * size / 1000)
    side = least if width is None else width / 1000
    tip = f"end-{spec.module_count}"
    bodies = ("base", tip) if tip_only else ()
    tags = TagLayout.collars(spec.module_count, size / 1000, side / 2, bodies)
    for path in print_tags(tags, out, paper, side):
        print(f"tags: {path}")
    save_layout(tags, layout)
    print(
        f"layout: {layout}; collars of {1000 * side:g} mm, {counted(len(tags.tags), 'tag')}"
    )


def _check_length(millimeters: float, name: str) -> None:
    if not 5 <= millimeters <= 500:
        raise S2C2AError(f"{name} {millimeters:g}; give 5 to 500 mm")


def _board(columns: int, rows: int, square: float) -> "Board":
    from pydantic import ValidationError

    from s2c2a.files.validation import explained
    from s2c2a.lab.tracking.tags import Board

    size = square / 1000
    try:
        return Board(columns=columns, rows=rows, square=size, marker=0.75 * size)
    except ValidationError as error:
        raise S2C2AError(explained(error, "no such board:", ())) from error


@app.command(name="calibrate-camera")
@effective(
    "views",
    "resolution",
    where="with a camera or a video file as --source, without --print-board",
    holds=lambda given: not (given["print_board"] or Path(given["source"]).is_dir()),
)
@effective(
    "source",
    where="without --print-board",
    holds=lambda given: not given["print_board"],
)
@effective(
    "paper", where="with --print-board", holds=lambda given: given["print_board"]
)
def calibrate_camera(
    source: Device = "0",
    out: OptionalPath = None,
    columns: int = 7,
    rows: int = 5,
    square: float = 35.0,
    views: int = 20,
    resolution: tuple[int, int] = (1280, 720),
    print_board: bool = False,
    paper: PaperName = "a4",
) -> None:
    """Find the projection of a camera from pictures of the printed board.

    Print the board first (--print-board), at 100 %; measure the squares, and glue the
    sheet to a flat plate. With a camera, hold the board still, then move it: near, far,
    tilted by about 40 degrees, and into the corners of the picture. A picture is taken
    whenever the board rests in a new place.

    Args:
        source: number or path of a camera, a video file, or a folder of pictures.
        out: camera file to write, by default camera.json; with --print-board, PDF or PNG
            (600 dpi), by default board.pdf.
        columns: of squares.
        rows: of squares.
        square: side of a square as measured on the paper [mm].
        views: pictures to take with a camera.
        resolution: width and height of a camera's pictures [pixels]; that of tracking.
        print_board: print the board instead.
        paper: sheet of the board, landscape.
    """
    from s2c2a.lab.tracking.tags import printing, save_camera
    from s2c2a.lab.tracking.tags.calibration import GOOD_RMS
    from s2c2a.lab.tracking.tags.live_calibration import (
        calibrate_folder,
        calibrate_source,
    )

    board = _board(columns, rows, square)
    if print_board:
        for path in printing.print_board(board, out or Path("board.pdf"), paper):
            print(f"board: {path}")
        return
    out = out or Path("camera.json")
    if Path(source).is_dir():
        camera = calibrate_folder(Path(source), board)
    else:
        with progress_bar() as progress:
            camera = calibrate_source(source, board, views, resolution, progress)
    save_camera(camera, out)
    print(f"camera: {out}; {counted(camera.views, 'view')}")
    print(f"field of view: {camera.field_of_view:.1f} deg (horizontal)")
    verdict = "good" if camera.rms <= GOOD_RMS else "usable; better pictures help"
    print(f"rms error: {camera.rms:.2f} pixels, {verdict} (good: at most {GOOD_RMS})")
