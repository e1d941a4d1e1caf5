"""Emulated servos in a process of its own, which a test starts, disturbs and asks.

Every line of its input is a command, every line of its output the answer: a JSON object
with options starts an emulator, "status" describes it, "stop" ends it, and everything
else is a fault that occurs now.
"""

import json
import os
import queue
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.lab.emulation import Emulator, EmulatorOptions
from s2c2a.lab.emulation.faults import apply_fault, parse_faults
from s2c2a.lab.emulation.outputs import describe

PATIENCE = 60.0  # s


class EmulatorProcess:
    """The test's side; a context manager that ends the process."""

    def __init__(self):
        command = [sys.executable, __file__]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.stdin.close()
        self._process.wait(PATIENCE)
        self._process.stdout.close()

    def start(self, arm_file, link, **options):
        """Power the servos up; returns when the port is open."""
        self._ask(json.dumps({"arm": str(arm_file), "link": str(link), **options}))

    def inject(self, fault):
        """Let a fault occur, such as "gone 4 0.5"."""
        self._ask(fault)

    def status(self):
        """Describe the servos, as in a status file."""
        return json.loads(self._ask("status"))

    def stop(self):
        """Switch the servos off; the last state."""
        status = self.status()
        self._ask("stop")
        return status

    def _ask(self, line):
        print(line, file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        assert answer, f"the emulator ended after {line!r}"
        return answer


def main():
    class Disturbed(Emulator):
        """An emulator that obeys lines between its steps."""

        def serve(self):
            while not lines.empty():
                self.obey(lines.get())
            super().serve()

        def obey(self, line):
            if line == "status":
                say(describe(self))
                return
            if line in ("stop", ""):
                self.stop()
                return
            (fault,) = parse_faults([f"0 {line}"], self._ids)
            apply_fault(fault, self)
            say({})

    def say(answer):
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()

    def read_lines():
        for line in sys.stdin:
            lines.put(line.strip())
        lines.put("")

    # the emulator keeps real time beside other processes, where it may
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)
    lines = queue.Queue()
    threading.Thread(target=read_lines, daemon=True).start()
    while line := lines.get():
        options = json.loads(line)
        arm = load_arm(options.pop("arm"))
        link = Path(options.pop("link"))
        emulator = Disturbed(arm, EmulatorOptions(link=link, **options))
        emulator.run(lambda port: say({"port": port}))
        say({})


if __name__ == "__main__":
    main()
