"""The command `completion`, and its scripts in the shells that are installed."""

import shutil
import subprocess
from pathlib import Path

import pytest

from s2c2a.cli.main import main

COMPLETE_IN_BASH = """
source "$0"
COMP_WORDS=(s2c2a arm ch)
COMP_CWORD=2
_tyro_s2c2a
echo "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory) -> dict[str, Path]:
    """The script of every shell, as a file."""
    folder = tmp_path_factory.mktemp("completion")
    return {shell: folder / f"completion.{shell}" for shell in ("bash", "zsh", "fish")}


@pytest.fixture
def script(request, scripts, capsys) -> Path:
    """The script of one shell; it is printed once."""
    path = scripts[request.param]
    if not path.exists():
        with pytest.raises(SystemExit) as stopped:
            main(["completion", request.param])
        assert not stopped.value.code
        path.write_text(capsys.readouterr().out, encoding="utf-8")
    return path


@pytest.mark.parametrize("script", ["bash", "zsh", "fish"], indirect=True)
def test_the_script_of_a_shell_holds_commands_and_options(script):
    text = script.read_text(encoding="utf-8")
    for word in ("s2c2a", "collect", "reproduce", "--fidelity", "--trust"):
        assert word in text


@pytest.mark.parametrize("script", ["bash", "zsh", "fish"], indirect=True)
def test_a_shell_reads_its_script(script):
    shell = script.suffix.removeprefix(".")
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    read = subprocess.run(
        [shell, "-n", script], capture_output=True, text=True, check=False
    )
    assert read.returncode == 0, read.stderr


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_bash_completes_a_subcommand(script):
    completed = subprocess.run(
        ["bash", "-c", COMPLETE_IN_BASH, script],
        capture_output=True,
        text=True,
        check=True,
    )
    assert completed.stdout.split() == ["check"]


def test_an_unknown_shell_is_reported_with_the_known_ones(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["completion", "tcsh"])
    assert stopped.value.code == 2
    message = capsys.readouterr().err
    assert all(f"'{shell}'" in message for shell in ("tcsh", "bash", "zsh", "fish"))
