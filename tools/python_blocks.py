"""Process that executes the Python blocks of a page in one namespace.

Usage: `python python_blocks.py REQUESTS RESULTS`, two inherited file descriptors. A
request is a line of JSON with the file of the page, the line of the block and its text.
A result is a line: `passed` or `failed`. The exception is printed.
"""

import json
import os
import sys
import traceback


def main(requests: int, results: int) -> None:
    """Execute blocks until no more requests come."""
    sys.path[0] = ""  # imports from the page's folder, not from that of this file
    namespace = {"__name__": "__main__"}
    with os.fdopen(requests) as lines, os.fdopen(results, "w") as out:
        for line in lines:
            passed = execute(json.loads(line), namespace)
            sys.stdout.flush()
            out.write("passed\n" if passed else "failed\n")
            out.flush()


def execute(request: dict, namespace: dict) -> bool:
    """Execute a block; errors show its lines as those of the page."""
    text = "\n" * (request["line"] - 1) + request["text"]
    try:
        exec(compile(text, request["file"], "exec"), namespace)
    except BaseException:  # also SystemExit: the page goes on
        traceback.print_exc()
        return False
    return True


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
