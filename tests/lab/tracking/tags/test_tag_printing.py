import numpy as np
import pytest

from s2c2a.lab.tracking.tags import Board, TagLayout, find_board
from s2c2a.lab.tracking.tags.detection import detect_tags
from s2c2a.lab.tracking.tags.opencv import cv2
from s2c2a.lab.tracking.tags.printing import (
    PAPERS,
    PrintError,
    place_tags,
    print_board,
    print_tags,
)

PIXELS_PER_METER = 600 / 0.0254
SHRINK = 4


def read(path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    shape = (image.shape[1] // SHRINK, image.shape[0] // SHRINK)
    return cv2.resize(image, shape, interpolation=cv2.INTER_AREA)


def test_printed_tags_have_their_size_and_are_upright(tmp_path):
    layout = TagLayout.collars(1, bodies=["end-1"])
    (path,) = print_tags(layout, tmp_path / "tags.png", side=0.064)
    views = detect_tags(read(path), layout.by_id).views
    assert {view.id for view in views} == {10, 11, 12, 13, 14}
    for view in views:
        top, right, *_ = np.diff(view.corners, axis=0)
        side = 0.04 * PIXELS_PER_METER / SHRINK
        assert top == pytest.approx((side, 0), abs=0.6)
        assert right == pytest.approx((0, side), abs=0.6)


def test_four_papers_of_a_collar_touch_in_the_order_of_its_sides():
    (page,) = place_tags(TagLayout.collars(1, bodies=["base"]), PAPERS["a4"], 0.064)
    assert [placed.tag.id for placed in page] == [0, 1, 2, 3]
    assert np.diff([placed.left for placed in page]) == pytest.approx([0.064] * 3)


def test_tags_stay_on_the_paper_and_off_the_ruler():
    for page in place_tags(TagLayout.collars(9), PAPERS["letter"]):
        for placed in page:
            assert placed.left + placed.side < PAPERS["letter"][0]
            assert placed.bottom > 0.015


@pytest.mark.slow
def test_a_printed_board_is_found_and_has_its_size(tmp_path):
    board = Board()
    (path,) = print_board(board, tmp_path / "board.png")
    view = find_board(read(path), board)
    assert len(view.points) == 24
    scale = PIXELS_PER_METER / SHRINK
    size = np.ptp(view.pixels, axis=0)
    assert size == pytest.approx(np.array([5, 3]) * 0.035 * scale, abs=1)


def test_a_pdf_has_the_size_of_the_paper(tmp_path):
    (path,) = print_tags(TagLayout.collars(3), tmp_path / "tags.pdf", "a4")
    assert b"/MediaBox [ 0 0 841.88" in path.read_bytes()


@pytest.mark.parametrize(
    ("options", "name"),
    [({"paper": "a0"}, "tags.pdf"), ({"side": 0.4}, "tags.pdf"), ({}, "tags.txt")],
)
def test_what_cannot_be_printed_is_refused(tmp_path, options, name):
    with pytest.raises(PrintError):
        print_tags(TagLayout.collars(1), tmp_path / name, **options)
    with pytest.raises(PrintError, match="does not fit"):
        print_board(Board(columns=14), tmp_path / "board.pdf")
