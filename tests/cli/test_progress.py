"""Progress in a file: lines at intervals, so that a log shows the state of the work."""

from s2c2a.cli import console


def lines_of(capsys) -> list[str]:
    with console.progress_bar() as progress:
        for done in range(4):
            progress("training C2S", done, 3)
        progress("making runs", 1, 9)
    return capsys.readouterr().err.splitlines()


def test_each_piece_of_work_has_a_line(capsys):
    assert lines_of(capsys) == ["training C2S ...", "making runs ..."]


def test_long_work_prints_the_steps_done(capsys, monkeypatch):
    monkeypatch.setattr(console, "LINE_INTERVAL", 0.0)
    assert lines_of(capsys)[1:4] == [f"training C2S: {done} of 3" for done in (1, 2, 3)]


def test_units_in_brackets_are_printed(capsys):
    console.print_table("Errors [mm]", ("body", "position [mm]"), [("end-1", "0.05")])
    output = capsys.readouterr().out
    assert "Errors [mm]" in output
    assert "position [mm]" in output
