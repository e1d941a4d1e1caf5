"""Results say which sources made them."""

import subprocess

from s2c2a.execution import versions


def test_the_commit_of_a_checkout_says_whether_its_sources_were_changed(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(versions, "CHECKOUT", tmp_path)
    commit = versions._commit.__wrapped__
    assert commit() == ""
    git = ("git", "-C", tmp_path, "-c", "user.name=A", "-c", "user.email=a@b.example")
    for command in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "First"]):
        subprocess.run([*git, *command], check=True)
    clean = commit()
    assert len(clean) == 40
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "new.md").touch()
    assert commit() == clean
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "new.py").touch()
    assert commit() == f"{clean} with changes"
