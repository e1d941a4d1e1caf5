"""What a part's process does: its order in, its lines out."""

import json
import traceback
from typing import Any, TextIO

from s2c2a.bench.lines import Failed, Line, line_to_json, options_from_json
from s2c2a.bench.machine import peak_memory
from s2c2a.bench.measurement import memory
from s2c2a.bench.parts import PARTS
from s2c2a.errors import S2C2AError


def serve(order: str, said: TextIO) -> None:
    """Measure a part and say every line of it as soon as it is known, progress in between.

    Args:
        order: JSON with "part" and "options".
        said: takes a line of JSON each: {"progress": [...]} or {"line": {...}}.
    """
    asked = json.loads(order)
    name = asked["part"]

    def say(message: dict[str, Any]) -> None:
        said.write(json.dumps(message) + "\n")
        said.flush()

    def tell(line: Line) -> None:
        say({"line": line_to_json(line)})

    try:
        for line in PARTS[name].measure(
            options_from_json(asked["options"]), lambda doing, done, total: say({"progress": [doing, done, total]})
        ):
            tell(line)
    except S2C2AError as error:
        tell(Failed(name, str(error)))
    except Exception as error:  # whatever it is, what was measured before and what other parts measure still counts
        traceback.print_exc()
        tell(Failed(name, repr(error)))
    tell(memory("peak memory of this part", [peak_memory()]))
