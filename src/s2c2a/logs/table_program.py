"""Program that reads a log of strangers, and writes its table; `reading` runs it."""

import json
import sys

import numpy as np

from s2c2a.execution.child import limit_memory
from s2c2a.logs.errors import LogError
from s2c2a.logs.reading import read_here
from s2c2a.logs.tables import ColumnRequest, pack_table


def main(path: str, out: str) -> None:
    """Write the table that the standard input requests."""
    limit_memory()
    request = ColumnRequest(**json.load(sys.stdin))
    try:
        np.savez(out, *pack_table(read_here(path, request)))
    except LogError as error:
        sys.exit(" ".join(str(error).split()))


if __name__ == "__main__":
    main(*sys.argv[1:])
