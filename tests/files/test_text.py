"""Atomic file writes."""

import os

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.files.text import atomic_write, write_atomically


def test_a_file_is_written_into_new_folders(tmp_path):
    path = write_atomically(b"content", tmp_path / "new" / "file.txt")
    assert path.read_bytes() == b"content"
    assert list(path.parent.iterdir()) == [path]


def test_a_failed_write_leaves_the_old_file_and_no_part(tmp_path, monkeypatch):
    path = write_atomically(b"old", tmp_path / "file.txt")

    def refuse(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(S2C2AError, match="disk full"):
        write_atomically(b"new", path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_path_below_a_file_is_rejected(tmp_path):
    write_atomically(b"", tmp_path / "file")
    with pytest.raises(S2C2AError, match="cannot write"):
        write_atomically(b"", tmp_path / "file" / "below")


def test_a_block_that_fails_leaves_the_old_file_and_no_part(tmp_path):
    path = write_atomically(b"old", tmp_path / "file.txt")

    def fail():
        with atomic_write(path) as part:
            part.write_bytes(b"half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_permissions_follow_the_umask(tmp_path):
    before = os.umask(0o022)
    try:
        assert write_atomically(b"", tmp_path / "file").stat().st_mode & 0o777 == 0o644
    finally:
        os.umask(before)


def test_a_folder_is_rejected_as_a_file():
    with pytest.raises(S2C2AError, match="is a folder"):
        write_atomically(b"", ".")
