"""JSON files of validated values: calibrations, camera models, layouts of tags."""

import json
import os
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from s2c2a.errors import S2C2AError
from s2c2a.files.text import MAX_TEXT, read_text, write_atomically
from s2c2a.files.validation import explained

Value = TypeVar("Value", bound=BaseModel)


def save_json(
    value: BaseModel, path: str | os.PathLike, fault: type[S2C2AError]
) -> None:
    """Write a value as JSON without its empty keys.

    An interruption leaves the former file.

    Args:
        value: to write.
        path: the file.
        fault: class of the exception.

    Raises:
        S2C2AError: the file cannot be written.
    """
    text = json.dumps(value.model_dump(mode="json", exclude_none=True), indent=1)
    write_atomically(text + "\n", path, fault)


def load_json(
    kind: type[Value],
    path: str | os.PathLike,
    fault: type[S2C2AError],
    name: str,
    advice: str,
    most: int = MAX_TEXT,
) -> Value:
    """Read and validate a value.

    Args:
        kind: class of the value.
        path: the file.
        fault: class of the exception.
        name: of the content, such as "calibration", for messages.
        advice: how to make such a file.
        most: maximum size [bytes].

    Raises:
        S2C2AError: there is no such file, or it is damaged.
    """
    if not Path(path).is_file():
        raise fault(f"there is no {name} {path}; {advice}")
    try:
        return kind.model_validate(json.loads(read_text(path, fault, most)))
    except ValidationError as error:
        if any(each["loc"] == ("format",) for each in error.errors()):
            text = f"{path} is a {name} of another version of S2C2A"
            raise fault(f"{text}, with another format; {advice}") from error
        heading = f"{path}: {{faults}} in the {name}; {advice}"
        raise fault(explained(error, heading, kind.model_fields)) from error
    except (ValueError, RecursionError) as error:
        raise fault(f"{path} is no {name}: {error}; {advice}") from error
