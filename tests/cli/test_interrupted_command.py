"""Control-C at any moment of the command: no traceback, and the exit code says so."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

TELLS_WHEN_IT_HEEDS = """
import sys

class Teller:
    def find_spec(self, name, *_):
        if name == "s2c2a.cli.main":
            print("heeds", flush=True)

sys.meta_path.insert(0, Teller())
sys.argv = ["s2c2a", *{arguments}]
from s2c2a.__main__ import main
main()
"""


@pytest.fixture
def interrupted():
    """What comes of a command that is interrupted some seconds after Python itself has begun: exit code, errors."""

    def run(arguments: tuple[str, ...], after: float, begun=lambda: True):
        script = TELLS_WHEN_IT_HEEDS.format(arguments=arguments)
        # a shell's background jobs are not
        attentive = signal.signal(signal.SIGINT, signal.default_int_handler)
        running = subprocess.Popen(
            [sys.executable, "-c", script],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        signal.signal(signal.SIGINT, attentive)
        assert running.stdout.readline() == "heeds\n"
        while not begun():
            time.sleep(0.1)
        time.sleep(after)
        os.kill(running.pid, signal.SIGINT)
        _, errors = running.communicate(timeout=60)
        return running.returncode, errors

    return run


@pytest.mark.parametrize(
    "after", np.random.default_rng(0).uniform(0.0, 3.0, 8).round(3)
)
def test_an_interrupt_at_any_moment_ends_the_command_without_a_traceback(
    interrupted, after
):
    code, errors = interrupted(("arm", "check", "twin_arm"), after)
    assert "Traceback" not in errors, errors
    assert "Exception" not in errors, errors
    # the last while Python itself ends; a shell calls it 130 too
    assert code in (0, 130, -signal.SIGINT), errors


def test_an_interrupted_verb_says_what_is_kept(interrupted, tmp_path):
    path = tmp_path / "x.episodes"
    arguments = ("collect", "--out", str(path), "--episodes", "500", "--threads", "1")
    code, errors = interrupted(arguments, 1.0, path.exists)
    assert code == 130, errors
    assert "Traceback" not in errors
    assert "collect` goes on with --resume" in errors
