"""Ctrl-C at any time of the command: no traceback, and exit code 130."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

SCRIPT = """
import sys

class ReadyFinder:
    def find_spec(self, name, *_):
        if name == "s2c2a.cli.main":
            print("ready", flush=True)

sys.meta_path.insert(0, ReadyFinder())
sys.argv = ["s2c2a", *{arguments}]
from s2c2a.__main__ import main
main()
"""


@pytest.fixture
def interrupted(interruptible):
    """Interrupt a command some seconds after its start; return exit code and errors."""

    def run(arguments: tuple[str, ...], after: float, started=lambda: True):
        script = SCRIPT.format(arguments=arguments)
        process = subprocess.Popen(
            [sys.executable, "-c", script],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdout.readline() == "ready\n"
        while not started():
            time.sleep(0.1)
        time.sleep(after)
        os.kill(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        return process.returncode, errors

    return run


MOMENTS = np.random.default_rng(0).uniform(0.0, 3.0, 8).round(3)  # s


@pytest.mark.parametrize(
    "after",
    [0.1, *[pytest.param(moment, marks=pytest.mark.slow) for moment in MOMENTS]],
)
def test_an_interrupt_at_any_moment_ends_the_command_without_a_traceback(
    interrupted, after
):
    code, errors = interrupted(("arm", "check", "twin_arm"), after)
    assert "Traceback" not in errors, errors
    assert "Exception" not in errors, errors
    # -SIGINT: while Python itself exits, which a shell reports as 130 too
    assert code in (0, 130, -signal.SIGINT), errors


def test_an_interrupted_command_says_what_is_kept(interrupted, tmp_path):
    path = tmp_path / "x.episodes"
    arguments = ("collect", "--out", str(path), "--episodes", "500", "--threads", "1")
    code, errors = interrupted(arguments, 1.0, path.exists)
    assert code == 130, errors
    assert "Traceback" not in errors
    assert "collect` goes on with --resume" in errors
