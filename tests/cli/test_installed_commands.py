"""Commands of other packages: entry points of `s2c2a.commands`."""

from importlib.metadata import EntryPoint

from s2c2a.cli import main as command_line


def greet() -> None:
    """A command of another package."""


def added(monkeypatch, name):
    """The commands beside those of the package once another one has this name."""
    point = EntryPoint(name, f"{__name__}:greet", "s2c2a.commands")
    verbs = dict(command_line.VERBS)
    monkeypatch.setattr(command_line, "VERBS", verbs)
    monkeypatch.setattr(command_line, "installed", lambda kind: {name: point})
    command_line._add_installed_commands()
    return verbs


def test_a_package_adds_a_command(monkeypatch, capsys):
    assert added(monkeypatch, "greet")["greet"].__doc__ == greet.__doc__
    assert capsys.readouterr().err == ""


def test_a_package_cannot_take_the_name_of_a_command(monkeypatch, capsys):
    before = command_line.VERBS["doctor"]
    assert added(monkeypatch, "doctor")["doctor"] is before
    assert "'doctor'" in capsys.readouterr().err
    assert "arm" not in added(monkeypatch, "arm")
