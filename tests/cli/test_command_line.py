"""The command line, as a user types it."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

from s2c2a.cli.main import main
from s2c2a.data import load_recording
from s2c2a.studies.tables import TABLES

EXAMPLES = Path(__file__).parents[2] / "examples"

VERBS = [
    "demo",
    "live",
    "view",
    "collect",
    "train",
    "run",
    "sweep",
    "bench",
    "doctor",
    "arm",
    "reproduce",
]


def run(*arguments: str) -> None:
    main(arguments)


def failing(capsys, *arguments: str) -> str:
    """Run a verb that must end with exit code 2 and return what it said."""
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb, capsys):
    with pytest.raises(SystemExit) as stopped:
        main([verb, "--help"])
    assert stopped.value.code == 0
    assert "usage" in capsys.readouterr().out


@pytest.mark.parametrize("table", [*TABLES, "all", "randomised-arms"])
def test_every_table_explains_itself(table, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["reproduce", table, "--help"])
    assert stopped.value.code == 0
    assert "usage" in capsys.readouterr().out


def test_help_imports_nothing_heavy():
    code = (
        "import sys\n"
        "from s2c2a.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'jax', 'mujoco', 'matplotlib', 'scipy', 'distributed', 'optuna', 'viser', 'websockets'}\n"
        "heavy &= set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_preset_can_be_checked_and_described(capsys):
    run("arm", "check", "twin_arm")
    run("arm", "describe", "simulated_arm")
    said = capsys.readouterr().out
    assert "twin_arm is sound: 3 modules, 3 cables each" in said
    assert "first bending mode" in said


def test_an_arm_can_be_copied_changed_and_drawn(tmp_path, capsys):
    mine = tmp_path / "mine.toml"
    run("arm", "copy", "twin_arm", str(mine))
    run("arm", "check", str(mine))
    run("arm", "draw", str(mine), "--out", str(tmp_path / "mine.png"))
    assert (tmp_path / "mine.png").stat().st_size > 10_000
    assert "exists" in failing(capsys, "arm", "copy", "twin_arm", str(mine))


def test_a_broken_arm_file_is_refused_with_the_key(tmp_path, capsys):
    mine = tmp_path / "mine.toml"
    run("arm", "copy", "twin_arm", str(mine))
    mine.write_text(mine.read_text().replace("length = 0.2\n", "length = 200\n", 1))
    said = failing(capsys, "arm", "check", str(mine))
    assert "modules.0.length" in said
    assert "1000" in said


def test_a_missing_arm_names_the_presets(capsys):
    assert "twin_arm" in failing(capsys, "arm", "check", "no_such_arm")


def test_an_unknown_task_names_the_tasks(capsys, tmp_path):
    assert "circle" in failing(
        capsys, "run", "triangle", "--out", str(tmp_path / "run")
    )


def test_data_training_and_a_run_go_from_file_to_file_on_an_arm_that_nobody_tuned_for(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path / "cache"))
    arm = ("--arm", str(EXAMPLES / "arms" / "two_module_arm.toml"))
    recording, strategy, folder = (
        tmp_path / "two.episodes",
        tmp_path / "two.safetensors",
        tmp_path / "run",
    )
    run("collect", *arm, "--out", str(recording))
    assert (tmp_path / "two.episodes.png").exists()
    quick = tmp_path / "quick.toml"
    quick.write_text(
        'based_on = "best"\nc2s.points = 200\nc2s_fit.max_epochs = 10\nc2a_fit.max_epochs = 10\n'
    )
    run("train", str(recording), "--recipe", str(quick), "--out", str(strategy))
    assert (tmp_path / "two.safetensors.png").exists()
    run(
        "run",
        "circle",
        *arm,
        "--strategy",
        "s2c2a",
        "pcc",
        "--weights",
        str(strategy),
        "--out",
        str(folder),
    )
    said = capsys.readouterr().out
    assert "replay:" in said
    rows = json.loads((folder / "results.json").read_text())
    assert [(row["strategy"], row["metric"], row["unit"]) for row in rows] == [
        ("s2c2a", "position", "cm"),
        ("pcc", "position", "cm"),
    ]
    assert all(0 < row["mean"] < 30 for row in rows)
    assert rows[0]["mean"] < 0.5 < rows[1]["mean"]  # cm: 1 % of the arm's length
    with open(folder / "metrics.csv", newline="") as file:
        steps = list(csv.DictReader(file))
    assert len(steps) == 2 * 200
    assert {(step["task"], step["seed"], step["metric"]) for step in steps} == {
        ("circle", "0", "position")
    }
    for row in rows:
        values = [
            float(step["value"])
            for step in steps
            if step["strategy"] == row["strategy"]
        ]
        assert abs(sum(values) / 200 - row["mean"]) < 1e-3
    options = json.loads((folder / "options.json").read_text())
    assert options["options"]["task"] == "circle"
    assert options["options"]["recipe"]["name"] == "quick"
    assert "jax" in options["versions"]
    assert (folder / "two_module_arm.html").stat().st_size > 10_000
    again = failing(
        capsys, "run", "circle", *arm, "--strategy", "pcc", "--out", str(folder)
    )
    assert "--overwrite" in again
    (folder / "two_module_arm.html").unlink()  # as if it had been interrupted
    run(
        "run",
        "circle",
        *arm,
        "--strategy",
        "s2c2a",
        "pcc",
        "--weights",
        str(strategy),
        "--out",
        str(folder),
    )
    assert (folder / "two_module_arm.html").exists()
    assert json.loads((folder / "results.json").read_text()) == rows
    other = failing(
        capsys, "run", "circle", "--arm", "simulated_arm", "--weights", str(strategy)
    )
    assert "trained for 'two_module_arm'" in other
    said = failing(
        capsys, "run", "circle", *arm, "--weights", str(strategy), "--recipe", "paper"
    )
    assert "trains otherwise" in said


def test_a_recipe_says_in_how_many_episodes_data_are_collected_unless_the_user_does(
    tmp_path,
):
    recipe = tmp_path / "two.toml"
    recipe.write_text('based_on = "best"\nepisodes = 2\n')
    for stated, count in ((), 2), (("--episodes", "1"), 1):
        out = tmp_path / f"{count}.episodes"
        run(
            "collect",
            "--recipe",
            str(recipe),
            "--samples",
            "10",
            "--out",
            str(out),
            *stated,
        )
        options = load_recording(out).options
        assert (options["episodes"], options["babbling"]) == (count, "mixed")


def test_a_task_goes_at_the_pace_that_is_asked_for(tmp_path, capsys):
    folder = tmp_path / "quick"
    run("run", "circle", "--strategy", "pcc", "--pace", "4", "--out", str(folder))
    with open(folder / "metrics.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == 200 / 4
    assert "step limit of 4 deg" in capsys.readouterr().out
    assert "0.01 to 10" in failing(capsys, "run", "circle", "--pace", "0")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "circle", "--controller", "pcc"), "--controller is now --strategy"),
        (("run", "circle", "--controller=pcc"), "--controller is now --strategy"),
        (
            ("run", "circle", "--strategy", "mine.safetensors"),
            "--weights mine.safetensors",
        ),
        (
            ("run", "circle", "--strategy=mine.safetensors"),
            "--weights mine.safetensors",
        ),
        (("live", "--strategy", "mine.safetensors"), "--strategy is now --weights"),
    ],
)
def test_an_option_of_an_older_version_is_answered_with_its_new_name(
    arguments, said, capsys
):
    assert said in failing(capsys, *arguments)


def test_what_a_sweep_cannot_try_is_refused_before_it_leaves_a_trace(tmp_path, capsys):
    def said(*arguments):
        return failing(capsys, "sweep", *arguments, "--out", str(tmp_path / "sweep"))

    assert "planner.solver.iterations" in said(
        "circle", "--vary", "planner.solver.iteration=5:60"
    )
    assert "no task 'triangle'" in said("triangle", "--vary", "correction=0,1")
    assert "at least one, such as circle" in said("--vary", "correction=0,1")
    assert "they share position" in said(
        "circle", "--vary", "correction=0,1", "--metric", "tilt"
    )
    assert "no recipe" in said(
        "circle", "--vary", "correction=0,1", "--recipe", "none.toml"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_cluster_that_is_none_is_refused_before_anything_is_collected(
    tmp_path, capsys
):
    said = failing(
        capsys,
        "collect",
        "--out",
        str(tmp_path / "twin.episodes"),
        "--cluster",
        "nowhere",
    )
    assert "no cluster 'nowhere'" in said
    assert "local for this machine" in said
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_no_run_is_never_overwritten(tmp_path, capsys):
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    failing(
        capsys,
        "run",
        "circle",
        "--strategy",
        "pcc",
        "--out",
        str(tmp_path),
        "--overwrite",
    )
    assert precious.read_text() == "mine"


def test_the_doctor_finds_this_machine_well(capsys):
    run("doctor")
    assert "keeps its promises" in capsys.readouterr().out
