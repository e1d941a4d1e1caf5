"""What Windows and macOS do not have, hidden here: no test has run there."""

import ast
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from s2c2a.cli import interrupts
from s2c2a.execution import executors
from s2c2a.integrations.environments.simulation import SimulationBatch
from s2c2a.live.cli import live

ROOT = Path(__file__).parents[1]
PROGRAMS = sorted(
    file
    for folder in ("src", "experiments", "tools")
    for file in (ROOT / folder).rglob("*.py")
)
POSIX = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
WITHOUT_WINDOWS = [
    f"s2c2a.lab.emulation.{name}" for name in ("emulator", "lab", "line")
]
"""Modules that say that they do not run on Windows."""
IMPORT_ALL = f"""
import os, signal, sys, importlib, pkgutil
sys.modules.update(dict.fromkeys({POSIX}))
for name in ("SCHED_RESET_ON_FORK", "fork", "openpty", "sched_getaffinity", "sysconf"):
    vars(os).pop(name, None)
for name in ("SIGHUP", "SIGUSR1"):
    vars(signal).pop(name, None)
import s2c2a
from s2c2a.errors import S2C2AError
for wing in ("arm", "cli", "episodes", "lab", "live", "logs", "runtime"):
    package = importlib.import_module(f"s2c2a.{{wing}}")
    for module in pkgutil.walk_packages(package.__path__, f"s2c2a.{{wing}}."):
        try:
            importlib.import_module(module.name)
        except S2C2AError as error:
            print(module.name, error)
"""


def calls(text: str):
    """Names and calls of functions."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            function = node.func
            name = getattr(function, "attr", getattr(function, "id", ""))
            yield name, node


def unnamed_encodings(text: str) -> list[str]:
    """Calls that read or write text in the encoding of the system."""
    found = []
    for name, call in calls(text):
        names = {keyword.arg for keyword in call.keywords}
        texts = [part.value for part in call.args if isinstance(part, ast.Constant)]
        match name:
            case "read_text":
                named = call.args
            case "write_text":
                named = call.args[1:]
            case "open" if {"w", "a", "x", "r", "w+", "r+"} & set(texts):
                named = ()
            case "run" | "Popen" | "check_output":
                named = {"text", "universal_newlines"}.isdisjoint(names)
            case _:
                continue
        if not named and "encoding" not in names:
            found.append(ast.unparse(call))
    return found


def test_a_call_without_an_encoding_is_found():
    lines = ["path.open('w')", "path.read_text()"]
    assert unnamed_encodings("\n".join(lines)) == lines
    assert unnamed_encodings("open(path, 'wb')\npath.read_text('utf-8')") == []


def test_every_text_file_names_its_encoding():
    found = {
        str(file.relative_to(ROOT)): unnamed_encodings(file.read_text("utf-8"))
        for file in PROGRAMS
    }
    assert {name: calls for name, calls in found.items() if calls} == {}


@pytest.mark.slow
def test_all_modules_are_imported_without_what_only_posix_has():
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", IMPORT_ALL],
        capture_output=True,
        encoding="utf-8",
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.partition(" ")[0] for line in lines] == WITHOUT_WINDOWS
    assert all(
        "pseudo-terminals, which Windows does not have" in line for line in lines
    )


def test_processes_are_counted_where_the_memory_is_unknown(monkeypatch):
    monkeypatch.delattr("os.sysconf")
    monkeypatch.setattr(executors, "all_cores", lambda: 128)
    assert executors.default_process_count() == 61


def test_environments_count_cores_where_the_system_names_none(monkeypatch):
    monkeypatch.delattr("os.sched_getaffinity", raising=False)
    assert SimulationBatch("Reach", "twin_arm", count=2).arm.name == "twin_arm"


def test_an_interrupt_is_repeated_without_ending_the_process(monkeypatch):
    sent = []
    monkeypatch.setattr(interrupts.os, "name", "nt")
    monkeypatch.setattr(interrupts.os, "kill", pytest.fail)
    monkeypatch.setattr(signal, "raise_signal", sent.append)

    def timer(_, call, given):
        """One that does not wait."""
        return SimpleNamespace(start=lambda: call(*given))

    monkeypatch.setattr(interrupts.threading, "Timer", timer)
    interrupts._repeat_interrupt()
    assert sent == [signal.SIGINT]


def test_control_c_ends_the_wait_of_pages(monkeypatch):
    """Only a sleep, and no wait for an event, is interrupted on Windows."""
    waits = []

    def sleep(seconds):
        waits.append(seconds)
        raise KeyboardInterrupt

    monkeypatch.setattr(live.time, "sleep", sleep)
    live.wait_for_interrupt()
    assert len(waits) == 1
