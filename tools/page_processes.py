"""Processes of a page's blocks: shell commands, Python, and what runs beside them."""

import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from tools.pages import Block

QUESTION = b"[y/N] "
"""Ends a question of a command; a reader would answer it."""
QUIET = 2.0
"""s; a program in the background is ready if it has printed nothing for so long."""
READY_LIMIT = 120.0  # s
STOP_LIMIT = 20.0  # s; before a stopped program is killed
DRIVER = Path(__file__).with_name("python_blocks.py")


class BlockError(Exception):
    """A block failed; the message says why.

    Attributes:
        output: end of what it printed.
    """

    def __init__(self, message: str, output: str = "") -> None:
        super().__init__(message)
        self.output = output


class Process:
    """A running program, its output, and a terminal that agrees to its questions."""

    def __init__(
        self,
        command: Sequence[str],
        folder: Path,
        environment: dict[str, str],
        inherited: Sequence[int] = (),
    ) -> None:
        self._terminal, terminal_of_program = pty.openpty()
        self._program = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=terminal_of_program,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            pass_fds=tuple(inherited),
        )
        os.close(terminal_of_program)
        self._output = bytearray()
        self._last_output = time.monotonic()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def output(self) -> str:
        """Everything printed since the last `clear`."""
        return self._output.decode(errors="replace")

    @property
    def status(self) -> int | None:
        """Exit status; None while it runs."""
        return self._program.poll()

    def clear(self) -> None:
        """Forget the output."""
        self._output.clear()

    def wait(self, limit: float) -> int:
        """Exit status.

        Raises:
            BlockError: it runs for longer than the limit [s].
        """
        try:
            status = self._program.wait(limit)
        except subprocess.TimeoutExpired:
            raise BlockError(f"took more than {limit:g} s") from None
        self._reader.join(0.5)  # a child in the background may keep the pipe open
        return status

    def wait_until_ready(self) -> None:
        """Wait until it has printed something and then nothing for a while.

        Raises:
            BlockError: it ended, or printed nothing.
        """
        end = time.monotonic() + READY_LIMIT
        while time.monotonic() < end:
            if self.status is not None:
                raise BlockError(f"ended with status {self.status}")
            if self._output and time.monotonic() > self._last_output + QUIET:
                return
            time.sleep(0.1)
        raise BlockError(f"printed nothing within {READY_LIMIT:.0f} s")

    def stop(self) -> None:
        """Interrupt it as Control-C does; kill it if that does not help."""
        for number in (signal.SIGINT, signal.SIGTERM):
            self._signal(number)
            with suppress(subprocess.TimeoutExpired):
                self._program.wait(STOP_LIMIT)
                break
        self.kill()
        if self._terminal >= 0:
            os.close(self._terminal)
            self._terminal = -1

    def kill(self) -> None:
        """End it and its children at once."""
        self._signal(signal.SIGKILL)
        self._program.wait()
        self._reader.join(0.5)

    def _signal(self, number: int) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self._program.pid, number)

    def _read(self) -> None:
        pipe = self._program.stdout
        assert pipe is not None
        while piece := os.read(pipe.fileno(), 65_536):
            self._output += piece
            self._last_output = time.monotonic()
            if self._output.endswith(QUESTION):
                os.write(self._terminal, b"y\n")


class PythonProcess:
    """A Python process that executes blocks of a page in one namespace."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        requests_in, requests = os.pipe()
        results, results_out = os.pipe()
        inherited = (requests_in, results_out)
        command = [sys.executable, str(DRIVER), *map(str, inherited)]
        self.process = Process(command, folder, environment, inherited)
        for descriptor in inherited:
            os.close(descriptor)
        self._requests = os.fdopen(requests, "w")
        self._results = os.fdopen(results)

    def execute(self, block: Block, file: Path, limit: float) -> None:
        """Execute a block.

        Raises:
            BlockError: it raised an exception, or took too long.
        """
        self.process.clear()
        request = {"file": str(file), "line": block.line, "text": block.text}
        was_late = threading.Event()

        def kill() -> None:
            was_late.set()
            self.process.kill()  # which closes its pipe and ends the waiting below

        killer = threading.Timer(limit, kill)
        killer.start()
        try:
            self._requests.write(json.dumps(request) + "\n")
            self._requests.flush()
            result = self._results.readline().strip()
        except BrokenPipeError:
            result = ""
        killer.cancel()
        time.sleep(0.05)  # the last output may still be in the pipe
        if was_late.is_set():
            raise BlockError(f"took more than {limit:g} s")
        if result != "passed":
            raise BlockError("raised an exception" if result else "the process ended")

    def stop(self) -> None:
        """End the process."""
        with suppress(OSError):
            self._requests.close()
        with suppress(BlockError):
            self.process.wait(STOP_LIMIT)
        self._results.close()
        self.process.stop()
