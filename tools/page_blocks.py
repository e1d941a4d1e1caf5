"""Plugin of pytest that runs the commands and the Python code of Markdown pages.

`make docs PAGES="docs/guides/live.md README.md"` runs two pages. The blocks of a page run
in order, in a fresh folder that has the folders of the repository that pages use. A
comment directly above a block says how to treat it:

- `<!-- not run: REASON -->`: the block is skipped. The reason begins with one of
  `REASONS`.
- `<!-- in background -->`: a program that runs until it is stopped. It runs beside the
  following blocks until the page ends.
- `<!-- file: NAME -->`: the text is written to this file of the page's folder.
- `<!-- append: NAME -->`: the text is appended to this file.

Two comments stand alone:

- `<!-- background ends -->` stops what runs in the background.
- `<!-- run first:`, then lines of shell commands, then `-->`: commands that are not
  shown, such as those that make the files of another page.
"""

import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from unittest import SkipTest

from sybil import Document, Example, Region, Sybil
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown.lexers import (
    DirectiveInHTMLCommentLexer,
    FencedCodeBlockLexer,
)

from tools import ROOT

REASONS = (
    "a real arm",
    "a device",
    "longer than ten minutes",
    "trains networks for minutes",
    "another machine",
    "a server that runs until stopped",
    "installs software",
    "quoted code",
    "data that are not shipped",
)
"""Why a block may stay without a run."""

SHELLS = ("sh", "bash", "console")
COPIED = ("examples",)
LINKED = ("benchmarks", "results", "tools")
BLOCK_LIMIT = 600.0  # s
QUIET = 2.0
"""s; a program in the background is ready if it has printed nothing for so long."""
READY_LIMIT = 120.0  # s
STOP_LIMIT = 20.0  # s; before a stopped program is killed
ANSWER_PERIOD = 1.0  # s; questions of commands are answered so often
MARK = re.compile(r"<!--\s*(?P<name>[a-z ]+?)\s*(?::\s*(?P<detail>.*?))?\s*-->\s*$")
MARKS = ("not run", "in background", "file", "append")
FENCES = FencedCodeBlockLexer(r"[^\n]+")
HIDDEN_COMMANDS = DirectiveInHTMLCommentLexer("run first")
BACKGROUND_ENDS = DirectiveInHTMLCommentLexer("background ends")
STATE = "__page__"
"""Name of a page's `PageState` among the names of its Python blocks."""


class BlockError(Exception):
    """A block failed, or has a mark that cannot be obeyed."""


class PageState:
    """Folder and programs of a page."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="page-"))
        self.background: list[tuple[Example, subprocess.Popen]] = []
        for name in COPIED:
            shutil.copytree(ROOT / name, self.folder / name)
        for name in LINKED:
            (self.folder / name).symlink_to(ROOT / name)

    def end_background(self) -> None:
        """Stop the programs in the background."""
        for _, program in self.background:
            stop(program)
        self.background.clear()

    def check_background(self) -> None:
        """Report a program in the background that ended by itself with an error."""
        for example, program in self.background:
            if program.poll() not in (None, 0):
                raise BlockError(
                    f"the program of line {example.line} ended with status "
                    f"{program.returncode}"
                )


def language_of(region: Region) -> str:
    """First word behind the fence of a block."""
    return re.split(r"[\s{]", region.lexemes["language"].strip())[0]


def mark_of(document: Document, region: Region) -> tuple[str, str]:
    """Name and detail of the mark above a block; empty if it has none.

    Raises:
        BlockError: the mark lacks a reason or a name.
    """
    above = document.text[: region.start].removesuffix("\n").rpartition("\n")[2]
    found = MARK.match(above.strip())
    if found is None or found["name"] not in MARKS:
        return "", ""
    name, detail = found["name"], found["detail"] or ""
    place = f"{document.path}: {document.line_column(region.start)}"
    if name != "in background" and not detail:
        raise BlockError(f"{place}: the mark '{name}' needs ': ...'")
    if name == "not run" and not detail.startswith(REASONS):
        known = ", ".join(REASONS)
        raise BlockError(f"{place}: the reason '{detail}' begins with none of {known}")
    return name, detail


def blocks(document: Document) -> Iterator[Region]:
    """Blocks that run; others are only shown, such as tables and drawings."""
    for region in FENCES(document):
        mark, detail = mark_of(document, region)
        language = language_of(region)
        region.parsed = region.lexemes["source"]
        if mark == "not run":
            region.parsed = detail
            region.evaluator = skip
        elif mark in ("file", "append"):
            region.parsed = (detail, mark, region.lexemes["source"])
            region.evaluator = write_file
        elif language == "python":
            region.evaluator = run_python
        elif language in SHELLS:
            region.evaluator = start_program if mark else run_shell
        else:
            continue
        yield region


def comments(document: Document) -> Iterator[Region]:
    """Comments that stand alone."""
    for region in HIDDEN_COMMANDS(document):
        region.parsed = region.lexemes["source"]
        region.evaluator = run_shell
        yield region
    for region in BACKGROUND_ENDS(document):
        region.evaluator = end_background
        yield region


def skip(example: Example) -> None:
    """Report why a block is not run."""
    raise SkipTest(example.parsed)


def write_file(example: Example) -> None:
    """Write a block to a file of the page's folder."""
    name, mark, text = example.parsed
    path = state_of(example).folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a" if mark == "append" else "w", encoding="utf-8") as file:
        file.write(text)


def run_python(example: Example) -> None:
    """Execute a block; errors name lines of the page."""
    with time_limit(BLOCK_LIMIT):
        PythonEvaluator()(example)


def run_shell(example: Example) -> None:
    """Run commands until the first one fails."""
    with agreeing_terminal() as terminal:
        program = shell(example, stdin=terminal)
        try:
            with time_limit(BLOCK_LIMIT):
                status = program.wait()
        finally:
            stop(program)
    if status != 0:
        raise BlockError(f"exit status {status}")
    state_of(example).check_background()


def start_program(example: Example) -> None:
    """Start a program in the background; wait until it has printed something."""
    with tempfile.NamedTemporaryFile() as log:
        program = shell(example, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        state_of(example).background.append((example, program))
        try:
            wait_until_ready(program, Path(log.name))
        finally:
            print(Path(log.name).read_text(encoding="utf-8", errors="replace"))


def end_background(example: Example) -> None:
    """Stop what the page has started."""
    state_of(example).end_background()


def state_of(example: Example) -> PageState:
    """Folder and programs of the example's page."""
    return example.namespace[STATE]


def shell(example: Example, **streams: Any) -> subprocess.Popen:
    """Start the commands of a block in a group of processes of their own."""
    command = ["bash", "-e", "-o", "pipefail", "-c", example.parsed]
    folder = state_of(example).folder
    return subprocess.Popen(command, cwd=folder, start_new_session=True, **streams)


def wait_until_ready(program: subprocess.Popen, log: Path) -> None:
    """Wait until a program has printed something and then nothing for a while."""
    end = time.monotonic() + READY_LIMIT
    size, changed = 0, time.monotonic()
    while time.monotonic() < end:
        if program.poll() is not None:
            raise BlockError(f"ended with status {program.returncode}")
        if log.stat().st_size != size:
            size, changed = log.stat().st_size, time.monotonic()
        if size and time.monotonic() > changed + QUIET:
            return
        time.sleep(0.1)
    raise BlockError(f"printed nothing within {READY_LIMIT:.0f} s")


def stop(program: subprocess.Popen) -> None:
    """Interrupt a program as Control-C does; kill it, and whatever it has left."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(program.pid, number)
        with suppress(subprocess.TimeoutExpired):
            program.wait(STOP_LIMIT)
            break
    with suppress(ProcessLookupError):
        os.killpg(program.pid, signal.SIGKILL)


@contextmanager
def agreeing_terminal() -> Iterator[int]:
    """A terminal in which a reader types "y" again and again."""
    keyboard, terminal = pty.openpty()
    settings = termios.tcgetattr(terminal)
    settings[3] &= ~termios.ECHO  # nobody reads what the terminal shows
    termios.tcsetattr(terminal, termios.TCSANOW, settings)
    done = threading.Event()

    def type_answers() -> None:
        while not done.wait(ANSWER_PERIOD):
            os.write(keyboard, b"y\n")

    typist = threading.Thread(target=type_answers, daemon=True)
    typist.start()
    try:
        yield terminal
    finally:
        done.set()
        typist.join()
        os.close(terminal)
        os.close(keyboard)


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise an error in the main thread if its work takes longer."""

    def give_up(*_: object) -> None:
        raise BlockError(f"took more than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def begin_page(namespace: dict[str, Any]) -> None:
    """Make the page's folder, and the current one."""
    namespace["__name__"] = "__main__"
    namespace[STATE] = PageState()
    os.chdir(namespace[STATE].folder)
    sys.path.insert(0, str(namespace[STATE].folder))


def end_page(namespace: dict[str, Any]) -> None:
    """End all programs; forget the page's folder and what was imported from it."""
    state = namespace[STATE]
    state.end_background()
    os.chdir(ROOT)
    sys.path.remove(str(state.folder))
    for name, module in [*sys.modules.items()]:
        if str(getattr(module, "__file__", None)).startswith(str(state.folder)):
            del sys.modules[name]
    shutil.rmtree(state.folder, ignore_errors=True)


def pytest_configure() -> None:
    """Set the environment: the same installation, no windows, plain output."""
    programs = str(Path(sys.executable).parent.absolute())
    os.environ["PATH"] = os.pathsep.join([programs, os.environ.get("PATH", "")])
    paths = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    os.environ["PYTHONPATH"] = os.pathsep.join(os.path.abspath(path) for path in paths)
    os.environ |= {"MPLBACKEND": "Agg", "NO_COLOR": "1", "PYTHONUNBUFFERED": "1"}


PAGES = Sybil(
    [blocks, comments],
    path=str(ROOT),
    pattern="*.md",
    setup=begin_page,
    teardown=end_page,
)
pytest_collect_file = PAGES.pytest()
