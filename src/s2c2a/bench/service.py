"""What a part's process does: its order in, its lines out."""

import json
import traceback
from typing import Any, TextIO

import jax

from s2c2a.bench.lines import Failed, Line, line_to_json, options_from_json
from s2c2a.bench.machine import peak_memory
from s2c2a.bench.measurement import memory
from s2c2a.bench.parts import PARTS
from s2c2a.errors import S2C2AError


def check_device(device: str) -> None:
    """See whether JAX finds the device.

    Raises:
        S2C2AError: it finds no GPU, and one was asked for.
    """
    if device == "cpu":
        return
    try:
        jax.devices()
    except Exception as error:  # JAX has several for it
        raise S2C2AError(
            'JAX finds no GPU here; take --device cpu, or install `pip install ".[gpu]"` where there is one'
        ) from error


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
        options = options_from_json(asked["options"])
        check_device(options.device)
        for line in PARTS[name].measure(options, lambda *progress: say({"progress": progress})):
            tell(line)
    except S2C2AError as error:
        tell(Failed(name, str(error)))
    except Exception as error:  # whatever it is, what was measured before and what other parts measure still counts
        traceback.print_exc()
        tell(Failed(name, repr(error)))
    tell(memory("peak memory of this part", [peak_memory()]))
