"""Plugins: objects found by name."""

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.plugins.discovery import resolve, trust_code


def test_known_names_files_and_modules_are_resolved(tmp_path, monkeypatch):
    (tmp_path / "own_things.py").write_text("class Thing:\n    pass\n")
    monkeypatch.chdir(tmp_path)
    trust_code(f"{tmp_path}/own_things.py:Thing", "own_things:Thing")
    assert resolve("robot", "sim", {"sim": 1}) == 1
    assert resolve("robot", f"{tmp_path}/own_things.py:Thing", {}).__name__ == "Thing"
    assert resolve("robot", "own_things:Thing", {}).__module__ == "own_things"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("other", "choose one of sim"),
        ("nowhere:Thing", "cannot be loaded"),
        ("nowhere.py:Thing", "no file"),
    ],
)
def test_an_unknown_name_is_reported_with_the_known_ones(
    name, message, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    trust_code(name)
    with pytest.raises(S2C2AError, match=message):
        resolve("robot", name, {"sim": 1})


def test_an_error_in_a_user_file_is_reported_as_an_error_of_the_package(tmp_path):
    (tmp_path / "broken_things.py").write_text("raise ValueError('half done')\n")
    trust_code(f"{tmp_path}/broken_things.py:Thing")
    with pytest.raises(S2C2AError, match="half done"):
        resolve("robot", f"{tmp_path}/broken_things.py:Thing", {})
