"""The command line, end to end."""

import csv
import json
import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import s2c2a
from s2c2a.cli.doctor import _check_cache
from s2c2a.cli.main import GROUPS, NUMBER, VERBS, _check_options, help_of, main
from s2c2a_experiments.cli import TABLES

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(*arguments: str) -> None:
    main(arguments)


def test_every_table_has_a_line_of_help(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["reproduce", "--help"])
    assert stopped.value.code == 0
    shown = capsys.readouterr().out
    for table in TABLES:
        assert f"{table}: " in shown.replace("`", "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("obstacle", "no table 'obstacle' (did you mean obstacles?)"),
        (
            "scenes --recipe paper",
            "--recipe would have no effect on the table 'scenes'",
        ),
        ("reach --seeds 2 --beside x", "--seeds and --beside would have no effect"),
        ("paths x.episodes", "FILE would have no effect"),
        ("payloads", "made from files; name them"),
    ],
)
def test_a_table_takes_only_options_with_an_effect(arguments, message, refusal):
    assert message in refusal("reproduce", *arguments.split())


def test_the_version_is_printed(capsys):
    run("--version")
    assert capsys.readouterr().out == f"s2c2a {s2c2a.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("colect", "no command 'colect'; did you mean collect?"),
        ("xyz", "see s2c2a --help"),
        ("arm chek twin_arm", "no command 'arm chek'; did you mean check?"),
        ("tracking accuracy", "'tracking accuracy'; see s2c2a tracking --help"),
        ("run circle --weigths 1", "(did you mean --weights?)"),
        ("run circle --known_paylod=1", "(did you mean --known-payload?)"),
        ("arm random --sed 1", "(did you mean --seed?)"),
        ("motors scan --prot 1", "(did you mean --port?)"),
        ("run circle --fidelity acurate", "(did you mean accurate?)"),
        ("run circle --guard=am", "(did you mean arm?)"),
        ("collect --out x --babbling stagd", "(did you mean staged?)"),
        ("live --host 127.0.0.2", "(did you mean 127.0.0.1?)"),
        ("emulate mocap --protocol natnt", "(did you mean natnet?)"),
        ("tracking print-tags --paper leter", "(did you mean letter?)"),
        ("run cirle", "(did you mean circle?)"),
        ("run circle --arm twin_am", "(did you mean twin_arm?)"),
        ("run circle --strategy pc", "(did you mean pcc?)"),
        ("run circle --robot dynamixl", "(did you mean dynamixel?)"),
        ("run circle --recipe besst", "(did you mean best?)"),
    ],
)
def test_a_misspelled_word_is_answered_with_the_likely_one(refusal, arguments, message):
    answer = refusal(*arguments.split())
    assert message in answer
    assert answer.count("\n") == 1


def test_every_value_of_a_closed_list_is_accepted():
    for value in ("staged", "None"):
        _check_options(["collect", "--babbling", value])
    _check_options(["emulate", "mocap", "--up="])


BEYOND = {"INT": ("-1", "1" + "0" * 20), "FLOAT": ("nan", "-inf", "1e308")}


def numbers_of_all_commands():
    """Command, option and kind of every number that a command takes."""
    groups = GROUPS.items()
    grouped = [
        f"{name} {each}" for name, (app, _) in groups for each in app._subcommands
    ]
    for command in (*VERBS, *grouped):
        words = command.replace("_", "-").split()
        assert "{None}" not in help_of(words), words
        for option, kind in re.findall(NUMBER, help_of(words)):
            yield words, option, kind


def test_every_number_of_every_command_has_a_range(refusal):
    checked = list(numbers_of_all_commands())
    assert len(checked) > 70
    for words, option, kind in checked:
        for number in BEYOND[kind]:
            message = refusal(*words, option, number)
            assert f"{option} {number} is out of range; give a number from" in message


@pytest.mark.parametrize("columns", ["1", "24", "400", ""])
def test_the_width_of_the_terminal_changes_nothing_that_is_accepted(
    columns, monkeypatch, refusal
):
    monkeypatch.setenv("COLUMNS", columns)
    assert "no option --sed" in refusal("arm", "random", "--sed", "1")
    _check_options(["run", "circle", "--max-compensated-force", "1"])
    assert "usage" in help_of(["collect"])


def test_the_list_of_commands_has_a_sentence_for_each(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = capsys.readouterr().out
    assert "Make one of the project's tables" in listed
    assert "Table III" not in listed


def test_a_reader_that_closes_the_output_is_no_fault():
    command = f"{sys.executable} -u -m s2c2a arm check twin_arm | true"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True
    )
    assert (done.stderr, done.returncode) == ("", 0)


def test_help_imports_no_large_package():
    code = (
        "import sys\n"
        "from s2c2a.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "large = 'jax mujoco matplotlib scipy distributed viser websockets'.split()\n"
        "large = set(large) & set(sys.modules)\n"
        "sys.exit(f'imported {large}' if large else 0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_preset_can_be_checked(capsys):
    run("arm", "check", "twin_arm")
    output = capsys.readouterr().out
    assert (
        "twin_arm is valid: twin_arm, 3 modules of 3 cables, 0.6 m, 0.24 kg" in output
    )
    assert "first bending mode" in output
    assert "cables at mm" in output


def test_warnings_of_a_command_are_sentences_without_the_line_of_code(monkeypatch):
    def show(_):
        warning = ("the arm is late", UserWarning, "loop.py", 7)
        shown.append(warnings.formatwarning(*warning))

    shown = []
    before = warnings.formatwarning
    monkeypatch.setattr("s2c2a.cli.main._run_command", show)
    run()
    assert shown == ["warning: the arm is late\n"]
    assert warnings.formatwarning is before


def test_an_arm_can_be_copied_changed_and_drawn(tmp_path, refusal):
    mine = tmp_path / "mine.toml"
    run("arm", "copy", "twin_arm", str(mine))
    run("arm", "check", str(mine))
    run("arm", "draw", str(mine), "--out", str(tmp_path / "mine.png"))
    assert (tmp_path / "mine.png").stat().st_size > 10_000
    assert "exists" in refusal("arm", "copy", "twin_arm", str(mine))


def test_an_invalid_arm_file_is_rejected_with_its_key(tmp_path, refusal):
    mine = tmp_path / "mine.toml"
    run("arm", "copy", "twin_arm", str(mine))
    mine.write_text(mine.read_text().replace("length = 0.2\n", "length = 200\n", 1))
    output = refusal("arm", "check", str(mine))
    assert "modules.0.length" in output
    assert "1000" in output


def test_the_page_of_another_robot_is_for_this_machine_only(refusal):
    options = ("--robot", "dynamixel", "--host", "0.0.0.0")
    assert "leave out --host" in refusal("live", *options)


def test_an_unknown_task_names_the_tasks(refusal, tmp_path):
    assert "circle" in refusal("run", "triangle", "--out", str(tmp_path / "run"))


SMALL = """
based_on = "paper"
c2s.layers = 1
c2s.hidden = 8
c2a.layers = 1
c2a.hidden = 8
c2s_fit.max_epochs = 2
c2a_fit.max_epochs = 2
"""
WHOLE = """
based_on = "best"
c2s.points = 200
c2s_fit.max_epochs = 10
c2a_fit.max_epochs = 10
"""


@pytest.mark.parametrize(
    ("networks", "samples", "strategies", "error"),
    [
        pytest.param(SMALL, 100, ("s2c2a",), 30.0, id="small"),
        # cm: 1 % of the arm's length
        pytest.param(
            WHOLE, 500, ("s2c2a", "pcc"), 0.5, id="whole", marks=pytest.mark.slow
        ),
    ],
)
def test_collect_train_and_run_work_on_an_arm_without_tuning(
    networks, samples, strategies, error, tmp_path, refusal, capsys, monkeypatch
):
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path / "cache"))
    arm = ("--arm", str(EXAMPLES / "arms" / "two_module_arm.toml"))
    recording = tmp_path / "two.episodes"
    strategy = tmp_path / "two.safetensors"
    folder = tmp_path / "run"
    amount = ("--episodes", "10", "--samples", str(samples))
    run("collect", *arm, *amount, "--out", str(recording))
    assert (tmp_path / "two.episodes.png").exists()
    quick = tmp_path / "quick.toml"
    quick.write_text(networks)
    run("train", str(recording), "--recipe", str(quick), "--out", str(strategy))
    assert (tmp_path / "two.safetensors.png").exists()
    weights = ("--weights", str(strategy), "--out", str(folder))
    run("run", "circle", *arm, "--strategy", *strategies, *weights)
    output = capsys.readouterr().out
    assert "replay:" in output
    rows = json.loads((folder / "results.json").read_text())
    assert [(row["strategy"], row["metric"], row["unit"]) for row in rows] == [
        (name, "position", "cm") for name in strategies
    ]
    assert all(0 < row["mean"] < 30 for row in rows)
    assert rows[0]["mean"] < error
    assert all(row["mean"] > 0.5 for row in rows[1:])
    with open(folder / "metrics.csv", newline="") as file:
        steps = list(csv.DictReader(file))
    assert len(steps) == len(strategies) * 200
    assert {(step["task"], step["seed"], step["metric"]) for step in steps} == {
        ("circle", "0", "position")
    }
    for row in rows:
        own = [step for step in steps if step["strategy"] == row["strategy"]]
        total = sum(float(step["value"]) for step in own)
        assert abs(total / 200 - row["mean"]) < 1e-3
    options = json.loads((folder / "options.json").read_text())
    assert options["options"]["task"] == "circle"
    assert options["options"]["recipe"]["name"] == "quick"
    assert "jax" in options["versions"]
    assert (folder / "two_module_arm.html").stat().st_size > 10_000
    circle = ("run", "circle")
    again = refusal(*circle, *arm, "--strategy", "pcc", "--out", str(folder))
    assert "--overwrite" in again
    (folder / "two_module_arm.html").unlink()  # as if it had been interrupted
    run("run", "circle", *arm, "--strategy", *strategies, *weights)
    assert (folder / "two_module_arm.html").exists()
    assert json.loads((folder / "results.json").read_text()) == rows
    other = refusal(*circle, "--arm", "simulated_arm", *weights)
    assert "trained for 'two_module_arm'" in other
    assert "trains differently" in refusal(*circle, *arm, *weights, "--recipe", "paper")


def test_an_unknown_cluster_is_rejected_before_collecting(tmp_path, refusal):
    command = ["collect", "--cluster", "nowhere", "--out"]
    output = refusal(*command, str(tmp_path / "twin.episodes"))
    assert "no cluster 'nowhere'" in output
    assert "local for this machine" in output
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_no_run_directory_is_never_overwritten(tmp_path, refusal):
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    command = ["run", "circle", "--strategy", "pcc", "--overwrite", "--out"]
    refusal(*command, str(tmp_path))
    assert precious.read_text() == "mine"


def test_the_doctor_finds_no_problem(capsys):
    run("doctor")
    assert "fulfills the interface contract" in capsys.readouterr().out


def test_the_doctor_refuses_a_cache_that_is_a_file_or_others_can_write(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    programs = tmp_path / "executables"
    programs.mkdir(mode=0o700)
    assert _check_cache().endswith("GB free)")
    programs.chmod(0o775)
    assert "FAILED: others can write" in _check_cache()
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setenv("S2C2A_CACHE", str(file))
    assert "FAILED" in _check_cache()
