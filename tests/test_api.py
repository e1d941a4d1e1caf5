"""`import s2c2a` offers what a program writes first, and its docstring is complete."""

import ast
import re
import textwrap
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import s2c2a
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.tasks import Score, Task

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/get-started/python.md")


def first_program() -> str:
    """The program in the docstring of the package."""
    _, program, _ = re.split(r"\n\n(?=    import)|\n\n(?=The arm)", s2c2a.__doc__)
    return textwrap.dedent(program)


def short_task(arm) -> Task:
    """Three steps towards one point."""
    goal = s2c2a.Goal.of(arm.module_count).with_position([0.1, 0.0, 0.55])
    return Task("short", (goal,) * 3, (Score("position"),))


@pytest.fixture
def pcc(twin):
    return s2c2a.pcc_strategy(twin)


def test_every_name_is_there_and_has_a_line_in_the_docstring():
    lines = re.findall(r"^    (\w+)  +\S", s2c2a.__doc__, re.MULTILINE)
    assert sorted(lines) == s2c2a.__all__
    for name in s2c2a.__all__:
        assert getattr(s2c2a, name).__doc__


def test_the_first_program_has_ten_lines_and_stands_on_the_pages():
    program = first_program()
    assert len(list(filter(None, program.splitlines()))) <= 10
    for page in PAGES:
        assert f"```python\n{program}\n```" in (ROOT / page).read_text("utf-8"), page


def test_the_first_program_runs(twin, pcc, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    short = partial(s2c2a.collect, episodes=1, samples=12)
    monkeypatch.setattr(s2c2a, "collect", short)
    monkeypatch.setattr(s2c2a, "train", lambda recording, out, overwrite: pcc)
    monkeypatch.setattr(s2c2a.tasks, "circle", short_task)
    exec(compile(first_program(), "first program", "exec"), {})
    assert re.fullmatch(r"position \d+\.\d+ cm\n", capsys.readouterr().out)
    (episode,), _ = s2c2a.load_episodes("circle.episodes")
    assert episode.options["task"] == "short"


@pytest.mark.slow
def test_a_complete_recording_is_read_again(twin, tmp_path):
    collect = partial(s2c2a.collect, twin, tmp_path / "a.episodes", samples=8)
    first = collect(episodes=1)
    written = (tmp_path / "a.episodes").read_bytes()
    again = collect(episodes=1)
    assert (tmp_path / "a.episodes").read_bytes() == written
    np.testing.assert_array_equal(first.actions, again.actions)
    with pytest.raises(RecordingError, match="seed 0, now 1"):
        collect(episodes=1, seed=1)


def test_a_strategy_is_trained_saved_and_loaded(
    recording, tiny_recipe, tiny_networks, monkeypatch, tmp_path
):
    def trained(recording, recipe, seed, progress):
        assert recipe is tiny_recipe
        return tiny_networks

    monkeypatch.setattr("s2c2a.strategies.s2c2a.train_s2c2a", trained)
    out = tmp_path / "new" / "mine.safetensors"
    strategy = s2c2a.train(recording, out, recipe=tiny_recipe)
    loaded = s2c2a.load_strategy(out)
    assert loaded.name == "s2c2a"
    task = short_task(recording.arm)
    runs = [
        s2c2a.run(s2c2a.SimulatedRobot(recording.arm), each, task)
        for each in (strategy, loaded)
    ]
    np.testing.assert_array_equal(runs[0]["actions"], runs[1]["actions"])
    with pytest.raises(StrategyError, match=r"exists.*overwrite=True"):
        s2c2a.train(recording, out, recipe=tiny_recipe)


def test_a_file_of_another_kind_is_not_replaced_by_networks(recording, tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("mine")
    with pytest.raises(StrategyError, match="does not end in"):
        s2c2a.train(recording, text, overwrite=True)


def test_shipped_networks_need_the_arm():
    with pytest.raises(StrategyError, match="no arm was given; give one"):
        s2c2a.load_strategy("shipped")


def test_a_run_takes_the_name_of_a_task(twin, pcc, monkeypatch):
    monkeypatch.setitem(s2c2a.tasks.TASKS, "circle", short_task)
    run = s2c2a.run(s2c2a.SimulatedRobot(twin), pcc, "circle")
    assert run.options["task"] == "short"


def test_the_stub_exports_what_it_imports():
    stub = ast.parse((ROOT / "src/s2c2a/__init__.pyi").read_text("utf-8"))
    (exported,) = [node for node in stub.body if isinstance(node, ast.Assign)]
    assert ast.literal_eval(exported.value) == s2c2a.__all__
