import pytest

from s2c2a.cli.main import main
from s2c2a.lab.tracking.tags import load_layout


def run(capsys, *arguments) -> str:
    main(["tracking", *map(str, arguments)])
    return capsys.readouterr().out


def refused(capsys, *arguments) -> str:
    with pytest.raises(SystemExit):
        main(["tracking", *map(str, arguments)])
    return capsys.readouterr().err


def test_print_tags_writes_sheets_and_layout(tmp_path, capsys):
    sheet, layout = tmp_path / "tags.pdf", tmp_path / "tags.json"
    out = run(capsys, "print-tags", "--out", sheet, "--layout", layout, "--tip-only")
    assert "64 mm" in out
    assert sheet.stat().st_size > 1000
    assert load_layout(layout).bodies == ("base", "end-3")


def test_a_collar_that_is_too_narrow_is_refused(tmp_path, capsys):
    fault = refused(capsys, "print-tags", "--width", 30, "--out", tmp_path / "tags.pdf")
    assert "wider collar" in fault


def printed_board(tmp_path, *options):
    sheet = tmp_path / "board.pdf"
    return "calibrate-camera", "--print-board", "--out", sheet, *options


def test_the_board_is_printed(tmp_path, capsys):
    assert "board" in run(capsys, *printed_board(tmp_path))
    assert (tmp_path / "board.pdf").stat().st_size > 1000


def test_a_board_that_cannot_be_is_refused(tmp_path, capsys):
    fault = refused(capsys, *printed_board(tmp_path, "--columns", 2))
    assert "columns" in fault


def test_calibration_of_an_empty_folder_says_what_to_do(tmp_path, capsys):
    fault = refused(capsys, "calibrate-camera", "--source", tmp_path)
    assert "0 pictures" in fault
