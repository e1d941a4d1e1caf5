"""All results come from one command, in parts that are kept."""

import json
from pathlib import Path

import pytest

from s2c2a.errors import S2C2AError
from s2c2a_experiments import cli, everything


@pytest.fixture
def make(monkeypatch, tmp_path):
    """A function that makes two small parts; the second one fails if it is told to."""
    monkeypatch.chdir(tmp_path)
    calls = []

    def parts(tables, out):
        def one(work):
            calls.append(work.out.name)
            work.out.mkdir(parents=True, exist_ok=True)
            (work.out / "results.json").write_text(f'["{work.out.name}"]')
            (work.out / "figure.png").touch()

        def two(work):
            one(work)
            if broken:
                raise KeyboardInterrupt

        return {"one": one, "two": two}

    broken = False
    monkeypatch.setattr(everything, "_parts", parts)

    def make(fails=False, only=()):
        nonlocal broken
        broken = fails
        calls.clear()
        everything.everything({}, only=only)
        return list(calls)

    make.calls = calls
    return make


def test_an_interrupted_command_continues_with_the_part_that_it_left(make, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        make(fails=True)
    assert make.calls == ["one", "two"]
    assert make() == ["two"]
    assert make() == []
    results = tmp_path / "runs" / "everything" / "results"
    files = sorted(str(path.relative_to(results)) for path in results.rglob("*.*"))
    rows = ["made.json", "results.json"]
    assert files == [f"{part}/{file}" for part in ("one", "two") for file in rows]
    made = [json.loads(path.read_text()) for path in results.rglob("made.json")]
    assert all(part["finished"] for part in made)
    assert len({part["sources"] for part in made}) == 1


def test_some_parts_are_made_here_and_others_elsewhere(make):
    assert make(only=("two",)) == ["two"]
    assert make() == ["one"]
    with pytest.raises(S2C2AError, match=r"no part 'thre'.*; choose of one, two"):
        make(only=("thre",))


def test_parts_of_other_sources_are_refused(make, monkeypatch):
    make()
    monkeypatch.setattr(everything, "versions", lambda: {"sources": "others"})
    with pytest.raises(S2C2AError, match=r"'one' in .* other sources"):
        make()


def test_every_table_that_needs_no_files_is_a_part(tmp_path):
    parts = everything._parts(cli.TABLES, tmp_path)
    alone = {"all", "real", "payloads", "everything"}
    of_all = set(cli.PAPER) - {"paths"}
    assert set(cli.TABLES) - alone - of_all <= set(parts)
    assert {"best", "paper", "planners", *everything.REAL} <= set(parts)


def test_the_smoke_version_makes_few_parts_with_options_that_they_take(
    monkeypatch, tmp_path
):
    made = {}

    def part(name):
        def make(seeds=3, smoke=False, work=None):
            made[name] = (seeds, smoke, work.out)
            work.out.mkdir(parents=True)

        return make

    monkeypatch.chdir(tmp_path)
    parts = {name: part(name) for name in ("best", "stanford_trunk", "planners")}
    monkeypatch.setattr(everything, "_parts", lambda tables, out: parts)
    everything.everything({"interaction": ("", part("interaction"))}, smoke=True)
    folder = Path("runs", "smoke", "parts")
    assert made == {
        "interaction": (1, False, folder / "interaction"),
        "stanford_trunk": (3, False, folder / "stanford_trunk"),
        "planners": (3, True, folder / "planners"),
    }
