"""The process of one part: kept to its cores before anything heavy is imported, then at work.

A process of its own for every part: none inherits another's memory, threads or compiled programs, and one that dies
takes nothing with it. It reads its order from standard input and says what it has measured on standard output, in lines
of JSON.
"""

import sys
from importlib import import_module

from s2c2a.bench.machine import keep_to


def main() -> None:
    """Entry point: `python -m s2c2a.bench.worker CORES`."""
    keep_to(int(sys.argv[1]))
    said, sys.stdout = sys.stdout, sys.stderr  # what others print is no line of ours
    import_module("s2c2a.bench.service").serve(sys.stdin.read(), said)


if __name__ == "__main__":
    main()
