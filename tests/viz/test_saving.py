import pytest
from matplotlib.figure import Figure

from s2c2a.errors import S2C2AError
from s2c2a.viz.saving import save_figure, save_whole


def test_a_file_is_written_whole_into_folders_that_are_made(tmp_path):
    path = save_whole(b"content", tmp_path / "new" / "file.txt")
    assert path.read_bytes() == b"content"
    assert list(path.parent.iterdir()) == [path]


def test_a_failed_write_leaves_the_old_file_and_no_part(tmp_path, monkeypatch):
    path = save_whole(b"old", tmp_path / "file.txt")

    def refuse(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(S2C2AError, match="disk full"):
        save_whole(b"new", path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_path_below_a_file_is_refused(tmp_path):
    save_whole(b"", tmp_path / "file")
    with pytest.raises(S2C2AError, match="cannot write"):
        save_whole(b"", tmp_path / "file" / "below")


def test_a_figure_that_fails_to_draw_leaves_nothing_behind(tmp_path):
    figure = Figure()
    figure.text(0.5, 0.5, r"$\nonsense$")
    with pytest.raises(ValueError, match="nonsense"):
        save_figure(figure, tmp_path / "figure.png")
    assert list(tmp_path.iterdir()) == []


def test_a_format_that_is_no_figure_is_refused(tmp_path):
    with pytest.raises(S2C2AError, match=r"not in '\.doc'"):
        save_figure(Figure(), tmp_path / "figure.doc")
