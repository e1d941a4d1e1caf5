"""Plugins: objects found by name."""

from s2c2a.plugins.discovery import resolve, trust_code


def test_known_names_files_and_modules_are_resolved(tmp_path, monkeypatch):
    (tmp_path / "own_things.py").write_text("class Thing:\n    pass\n")
    monkeypatch.chdir(tmp_path)
    trust_code(f"{tmp_path}/own_things.py:Thing", "own_things:Thing")
    assert resolve("robot", "sim", {"sim": 1}) == 1
    assert resolve("robot", f"{tmp_path}/own_things.py:Thing", {}).__name__ == "Thing"
    assert resolve("robot", "own_things:Thing", {}).__module__ == "own_things"
