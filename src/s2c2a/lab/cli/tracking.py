"""Commands `s2c2a tracking`: calibration of trackers; webcam and tags."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import tyro
from tyro.extras import SubcommandApp

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import Arm, print_table, progress_bar
from s2c2a.cli.dependent_options import effective
from s2c2a.errors import S2C2AError
from s2c2a.lab.cli.tracking_calibration import frames, latency

if TYPE_CHECKING:
    from s2c2a.lab.emulation.tag_accuracy import TagAccuracy
    from s2c2a.lab.tracking.tags import Board, TagDropReason, TagLayout

app = SubcommandApp()
command = app, "Calibrate a pose tracker; print tags for a webcam."
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
    width: float | None = None,
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
    least = max(_collar_width(spec), SHEET * size / 1000)
    side = least if width is None else width / 1000
    tip = f"end-{spec.module_count}"
    bodies = ("base", tip) if tip_only else ()
    tags = TagLayout.collars(spec.module_count, size / 1000, side / 2, bodies)
    for path in print_tags(tags, out, paper, side):
        print(f"tags: {path}")
    save_layout(tags, layout)
    print(f"layout: {layout}; collars of {1000 * side:g} mm, {len(tags.tags)} tags")


def _collar_width(arm: ArmSpec) -> float:
    return 2 * (max(module.cable_radius for module in arm.modules) + WALL)


def _check_length(millimeters: float, name: str) -> None:
    if not 5 <= millimeters <= 500:
        raise S2C2AError(f"{name} {millimeters:g}; give 5 to 500 mm")


@app.command(name="print-board")
def print_board(
    out: Path = Path("board.pdf"),
    columns: int = 7,
    rows: int = 5,
    square: float = 35.0,
    paper: PaperName = "a4",
) -> None:
    """Print the board that calibrates a camera.

    Print at 100 %, measure the squares, and glue the sheet to a flat plate.

    Args:
        out: PDF or PNG (600 dpi) to write.
        columns: of squares.
        rows: of squares.
        square: side of a square [mm].
        paper: sheet, landscape.
    """
    from s2c2a.lab.tracking.tags.printing import print_board

    for path in print_board(_board(columns, rows, square), out, paper):
        print(f"board: {path}")


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
    where="with a camera or a video file as --source",
    holds=lambda given: not Path(given["source"]).is_dir(),
)
def calibrate_camera(
    source: Device = "0",
    out: Path = Path("camera.json"),
    columns: int = 7,
    rows: int = 5,
    square: float = 35.0,
    views: int = 20,
    resolution: tuple[int, int] = (1280, 720),
) -> None:
    """Find the projection of a camera from pictures of the printed board.

    With a camera, hold the board still, then move it: near, far, tilted by about 40
    degrees, and into the corners of the picture. A picture is taken whenever the board
    rests in a new place.

    Args:
        source: number or path of a camera, a video file, or a folder of pictures.
        out: camera file to write.
        columns: of squares.
        rows: of squares.
        square: side of a square as measured on the paper [mm].
        views: pictures to take with a camera.
        resolution: width and height of a camera's pictures [pixels]; that of tracking.
    """
    from s2c2a.lab.tracking.tags import save_camera
    from s2c2a.lab.tracking.tags.calibration import GOOD_RMS
    from s2c2a.lab.tracking.tags.live_calibration import (
        calibrate_folder,
        calibrate_source,
    )

    board = _board(columns, rows, square)
    if Path(source).is_dir():
        camera = calibrate_folder(Path(source), board)
    else:
        with progress_bar() as progress:
            camera = calibrate_source(source, board, views, resolution, progress)
    save_camera(camera, out)
    print(f"camera: {out}; {camera.views} views")
    print(f"field of view: {camera.field_of_view:.1f} deg (horizontal)")
    verdict = "good" if camera.rms <= GOOD_RMS else "usable; better pictures help"
    print(f"rms error: {camera.rms:.2f} pixels, {verdict} (good: at most {GOOD_RMS})")


@app.command
def accuracy(
    arm: Arm = "twin_arm",
    camera: Path | None = None,
    layout: Path | None = None,
    distances: tuple[float, ...] = (0.5, 0.75, 1.0, 1.25, 1.5),
    pictures: int = 50,
    noise: float = 2.0,
    blur: float = 0.6,
    portrait: bool = False,
    seed: int = 0,
) -> None:
    """Measure how accurate a camera and tags are, on painted pictures of the arm.

    Args:
        camera: camera file; by default 1280 x 720 pixels and 60 degrees.
        layout: layout file; by default 40 mm tags on collars around all bodies.
        distances: of the tip from the camera [m].
        pictures: for each distance.
        noise: standard deviation of the gray values.
        blur: standard deviation of the blur [pixels].
        portrait: turn the camera by 90 degrees.
        seed: of bends and directions.
    """
    from s2c2a.lab.emulation.tag_accuracy import measure_accuracy
    from s2c2a.lab.tracking.tags.pictures import Effects

    _check_study(distances, pictures, noise, blur)
    spec = load_arm(arm)
    from s2c2a.lab.tracking.tags import CameraModel, load_camera

    model = (
        CameraModel.of_field(1280, 720, 60.0) if camera is None else load_camera(camera)
    )
    tags = _layout_or_default(layout, spec)
    with progress_bar() as progress:
        results = measure_accuracy(
            spec,
            model,
            tags,
            distances,
            pictures,
            Effects(noise, blur),
            portrait,
            seed,
            progress,
        )
    title = f"Tip of {spec.name}: median and 95th percentile of {pictures} pictures"
    _print_accuracy(title, results)


def _print_accuracy(title: str, results: "list[TagAccuracy]") -> None:
    header = (
        "distance [m]",
        "position [mm]",
        "95 %",
        "rotation [deg]",
        "95 %",
        "in base frame [mm]",
        "95 %",
        "missing",
        "wrong",
        "time [ms]",
    )
    print_table(title, header, map(_accuracy_cells, results))
    dropped: Counter[TagDropReason] = Counter()
    for result in results:
        dropped += result.dropped
    for reason, count in dropped.items():
        print(f"dropped {count} times: {reason.value}")


def _check_study(
    distances: tuple[float, ...], pictures: int, noise: float, blur: float
) -> None:
    if not all(0.1 <= distance <= 10 for distance in distances) or not distances:
        raise S2C2AError(f"distances {distances}; give 0.1 to 10 m")
    if not 1 <= pictures <= 100_000:
        raise S2C2AError(f"{pictures} pictures; give 1 to 100000")
    if not (0 <= noise <= 100 and 0 <= blur <= 20):
        raise S2C2AError(
            f"noise {noise:g} and blur {blur:g}; give a noise of 0 to 100 gray values "
            "and a blur of 0 to 20 pixels"
        )


def _layout_or_default(path: Path | None, arm: ArmSpec) -> "TagLayout":
    from s2c2a.lab.tracking.tags import TagLayout, load_layout
    from s2c2a.lab.tracking.tags.layout import HALF_WIDTH

    if path is not None:
        return load_layout(path)
    half_width = max(HALF_WIDTH, _collar_width(arm) / 2)
    return TagLayout.collars(arm.module_count, half_width=half_width)


def _accuracy_cells(result: "TagAccuracy") -> tuple[str, ...]:
    position, rotation, in_base = result.errors.T
    return (
        f"{result.distance:g}",
        *_quantiles(1000 * position),
        *_quantiles(np.degrees(rotation)),
        *_quantiles(1000 * in_base),
        f"{result.missing:.0%}",
        str(result.wrong),
        f"{1000 * np.median(result.seconds):.0f}",
    )


def _quantiles(errors: np.ndarray) -> tuple[str, str]:
    measured = errors[np.isfinite(errors)]
    if not measured.size:
        return "-", "-"
    median, high = np.quantile(measured, (0.5, 0.95))
    return f"{median:.2f}", f"{high:.2f}"
