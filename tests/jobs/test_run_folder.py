"""What is drawn of a run counts as its table does."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.files.text import (
    MANIFEST,
    atomic_write,
    list_in_manifest,
    listed_files,
    manifests_of_one_command,
    write_atomically,
)
from s2c2a.jobs.job import Conditions
from s2c2a.jobs.run_folder import open_run_directory, summary_of, trace_of
from s2c2a.planning import Goal
from s2c2a.robots import RobotFactory
from s2c2a.tasks import Score, Task

TWIN = load_arm("twin_arm")
STEPS, MODULES = 6, 3
EARLY, LATE = np.arange(STEPS) < 2, np.arange(STEPS) >= 2


def trace(*scores: Score):
    goal = (
        Goal.of(MODULES)
        .with_position([0.1, 0.0, 0.2], module=0)
        .with_position([0.1, 0.0, 0.5])
    )
    task = Task("two ends", (goal,) * STEPS, scores)
    columns = {"time": 0.1 * np.arange(STEPS), "actions": np.zeros((STEPS, MODULES, 3))}
    columns |= {
        "sensor.states": np.zeros((STEPS, MODULES, 6)),
        "desired_positions": task.desired_positions(),
    }
    run = SimpleNamespace(
        strategy="s2c2a", job=SimpleNamespace(task=task), episode=Episode(TWIN, columns)
    )
    return trace_of(run)


@pytest.mark.parametrize("tip", [-1, 2])
def test_counted_steps_are_those_of_the_drawn_module(tip):
    both = trace(
        Score("position", 0, EARLY),
        Score("position", tip, LATE),
        Score("recovery", tip, EARLY),
    )
    np.testing.assert_array_equal(both.counted, LATE)


def test_all_steps_count_without_a_position_score():
    assert trace(Score("position")).counted is None
    assert trace(Score("position", 0, EARLY)).counted is None


@pytest.mark.parametrize(
    ("factory", "named"),
    [
        (RobotFactory.simulation("accurate"), {"simulation": "accurate"}),
        (RobotFactory("dynamixel"), {"robot": "dynamixel"}),
    ],
)
def test_a_real_robot_is_not_called_a_simulation(factory, named):
    job = SimpleNamespace(
        recipe=SimpleNamespace(name="best"), conditions=Conditions(factory), seed=3
    )
    assert summary_of(job) == {"recipe": "best", "seed": "3"} | named


@pytest.fixture(autouse=True)
def _one_command():
    with manifests_of_one_command():
        yield


def run_in(folder, **options):
    """A command that writes two files into a run directory."""
    with manifests_of_one_command():
        open_run_directory(folder, "x", {"seed": 1}, overwrite=False, **options)
        write_atomically("rows", folder / "results.json")
        write_atomically("episode", folder / "runs" / "a.episodes")
    return folder


def refused(folder, message):
    with pytest.raises(S2C2AError, match=message):
        open_run_directory(folder, "x", {}, overwrite=True)


OTHERS = {
    "a file": lambda folder: (folder / "thesis.tex").write_text("of value"),
    "in a folder": lambda folder: (folder / "runs/thesis.tex").write_text("of value"),
    "hidden": lambda folder: (folder / ".thesis.tex.17.part").write_text("of value"),
    "an empty folder": lambda folder: (folder / "thesis.tex").mkdir(),
    "a link": lambda folder: (folder / "thesis.tex").symlink_to("/etc"),
    "of another command": lambda folder: write_atomically("x", folder / "thesis.tex"),
}


@pytest.mark.parametrize("add", OTHERS.values(), ids=OTHERS)
def test_a_run_directory_with_anything_else_is_not_replaced(tmp_path, add):
    folder = run_in(tmp_path / "run")
    add(folder)
    before = sorted(folder.rglob("*"))
    refused(folder, r"holds .*thesis\.tex")
    assert sorted(folder.rglob("*")) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run"]


def test_a_folder_of_the_user_is_not_replaced_for_the_names_of_its_files(tmp_path):
    for name in ("options.json", "thesis.tex"):
        (tmp_path / name).write_text("{}")
    refused(tmp_path, r"options\.json, thesis\.tex, which no run")
    assert (tmp_path / "thesis.tex").exists()
    (tmp_path / "thesis.tex").unlink()
    refused(tmp_path, r"options\.json, which no run")


def test_a_run_directory_is_replaced_whole(tmp_path):
    folder = run_in(tmp_path / "run")
    open_run_directory(folder, "x", {}, overwrite=True)
    assert sorted(path.name for path in folder.iterdir()) == [MANIFEST, "options.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run"]


def test_files_that_a_killed_process_was_writing_are_replaced(tmp_path):
    folder = run_in(tmp_path / "run")
    (folder / ".results.json.123.part").write_text("half")
    with open(folder / MANIFEST, "a") as manifest:
        manifest.write('"half a na')
    open_run_directory(folder, "x", {}, overwrite=True)


def test_a_continued_run_does_not_list_files_that_came_in_between(tmp_path):
    folder = run_in(tmp_path / "run")
    OTHERS["a file"](folder)
    run_in(folder, resume=True)
    names = {name for name, _ in listed_files(folder)}
    assert names == {"options.json", "results.json", "runs/a.episodes"}
    refused(folder, r"thesis\.tex")


def test_a_run_that_is_not_continued_names_what_changed(tmp_path):
    folder = run_in(tmp_path / "run")
    options = {"seed": 1, "session": {"date": "2026-11-30", "improves": True}}
    session = r"options\.session None, now \{'date': '2026-11-30', 'improves': True\}"
    with pytest.raises(S2C2AError, match=rf"other options or versions \({session}\); "):
        open_run_directory(folder, "x", options, overwrite=False, resume=True)
    run = tmp_path / "measured"
    open_run_directory(run, "x", options, overwrite=False)
    options["session"]["date"] = "2026-12-01"
    dates = r"options\.session\.date '2026-11-30', now '2026-12-01'"
    with pytest.raises(S2C2AError, match=dates):
        open_run_directory(run, "x", options, overwrite=False, resume=True)


@pytest.mark.parametrize("text", ["", "[" * 100_000, "[1]", "{}"])
def test_a_run_with_damaged_options_is_not_continued(tmp_path, text):
    folder = run_in(tmp_path / "run")
    (folder / "options.json").write_text(text)
    with pytest.raises(S2C2AError, match="is of other options or versions"):
        open_run_directory(folder, "x", {"seed": 1}, overwrite=False, resume=True)


def test_a_name_is_listed_before_its_file_is_written(tmp_path):
    open_run_directory(tmp_path / "run", "x", {}, overwrite=False)
    path = tmp_path / "run" / "late.json"
    with atomic_write(path) as part:
        part.touch()
        assert ("late.json", "") in listed_files(tmp_path / "run")
    list_in_manifest(tmp_path / "elsewhere.json")
    assert "elsewhere.json" not in (tmp_path / "run" / MANIFEST).read_text()


def test_a_link_to_a_run_directory_is_not_replaced(tmp_path):
    run_in(tmp_path / "run")
    (tmp_path / "link").symlink_to("run")
    refused(tmp_path / "link", "is a link")


@pytest.mark.parametrize(
    "line", ["[" * 100_000, "9" * 5000, "3", "null", '"a"', '["a"]', '["a", "b", "c"]']
)
def test_a_manifest_with_a_line_of_another_form_lists_nothing(tmp_path, line):
    folder = run_in(tmp_path / "run")
    with open(folder / MANIFEST, "a") as manifest:
        manifest.write(f"{line}\n")
    refused(folder, r"holds manifest\.jsonl")


@pytest.mark.parametrize("digest", ["", "0" * 64])
def test_a_listed_name_with_another_content_is_not_deleted(tmp_path, digest):
    folder = run_in(tmp_path / "run")
    (folder / "thesis.tex").write_text("of value")
    list_by_hand(folder, "thesis.tex", digest=digest)
    (folder / "results.json").write_text("changed by hand")
    refused(folder, r"holds results\.json, thesis\.tex")
    assert (folder / "thesis.tex").read_text() == "of value"


def list_by_hand(folder, *names, digest=""):
    with open(folder / MANIFEST, "a") as manifest:
        manifest.writelines(f"{json.dumps([name, digest])}\n" for name in names)


def test_names_in_a_manifest_delete_nothing_outside(tmp_path):
    outside = tmp_path / "dear" / "letter.tex"
    outside.parent.mkdir()
    outside.write_text("of value")
    folder = run_in(tmp_path / "run")
    list_by_hand(folder, "../dear/letter.tex", str(outside), "..", ".", "/", "", "a\0b")
    open_run_directory(folder, "x", {}, overwrite=True)
    assert outside.read_text() == "of value"


@pytest.mark.parametrize("name", ["link", "link/letter.tex"])
def test_a_link_in_place_of_what_is_listed_is_not_followed(tmp_path, name):
    outside = tmp_path / "dear"
    outside.mkdir()
    (outside / "letter.tex").write_text("of value")
    folder = run_in(tmp_path / "run")
    list_by_hand(folder, name)
    (folder / "link").symlink_to(outside)
    refused(folder, "holds link")


def test_a_manifest_that_is_a_link_is_not_written_through(tmp_path):
    folder = run_in(tmp_path / "run")
    (folder / MANIFEST).unlink()
    (tmp_path / "letter.tex").write_text("of value\n")
    (folder / MANIFEST).symlink_to(tmp_path / "letter.tex")
    with pytest.raises(S2C2AError, match="is a link"):
        run_in(folder, resume=True)
    assert (tmp_path / "letter.tex").read_text() == "of value\n"
