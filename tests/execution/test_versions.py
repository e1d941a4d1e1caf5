"""Results say which sources made them."""

import pytest

from s2c2a.execution import versions


@pytest.mark.parametrize("name", ["made.py", "arms/mine.toml"])
def test_another_file_of_the_package_is_another_digest(name, tmp_path, monkeypatch):
    monkeypatch.setattr(versions, "PACKAGE", tmp_path)
    digest_of = versions._sources.__wrapped__
    before = digest_of()
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("a = 1")
    after = digest_of()
    file.write_text("a = 2")
    assert len({before, after, digest_of()}) == 3
