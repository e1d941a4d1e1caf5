"""A small process that starts another one and tells how long it ran and how much memory it held at most.

Linux counts the memory of whoever starts a process as the process's own peak, so whoever starts it must be small: this
file is run as a script and imports nothing but the standard library.
"""

import os
import subprocess
import sys
import time


def main() -> None:
    """Run the command that is given as arguments; print its seconds and its peak memory as the system counts it."""
    began = time.perf_counter()
    process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    took = time.perf_counter() - began
    process.returncode = os.waitstatus_to_exitcode(status)
    sys.stdout.write(f"{took} {usage.ru_maxrss}\n")
    sys.exit(process.returncode)


if __name__ == "__main__":
    main()
