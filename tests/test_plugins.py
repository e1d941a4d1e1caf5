"""Things found by name."""

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.plugins import found


def test_a_known_name_a_file_and_a_module_are_found(tmp_path, monkeypatch):
    (tmp_path / "own_things.py").write_text("class Thing:\n    pass\n")
    monkeypatch.chdir(tmp_path)
    assert found("robot", "sim", {"sim": 1}) == 1
    assert found("robot", f"{tmp_path}/own_things.py:Thing", {}).__name__ == "Thing"
    assert found("robot", "own_things:Thing", {}).__module__ == "own_things"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("other", "choose one of sim"),
        ("nowhere:Thing", "cannot be loaded"),
        ("nowhere.py:Thing", "no file"),
    ],
)
def test_what_cannot_be_found_is_said_with_what_there_is(
    name, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(S2C2AError, match=said):
        found("robot", name, {"sim": 1})


def test_an_error_in_a_users_file_is_told_as_ours(tmp_path):
    (tmp_path / "broken_things.py").write_text("raise ValueError('half done')\n")
    with pytest.raises(S2C2AError, match="half done"):
        found("robot", f"{tmp_path}/broken_things.py:Thing", {})
