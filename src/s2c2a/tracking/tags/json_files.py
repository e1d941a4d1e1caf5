"""JSON files of validated values."""

import json
import os
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from s2c2a.files import read_text, write_atomically
from s2c2a.tracking.poses import TrackingError
from s2c2a.validation import explained

Value = TypeVar("Value", bound=BaseModel)


def save_json(
    value: BaseModel, path: str | os.PathLike, fault: type[TrackingError]
) -> None:
    """Write a value as JSON; an interruption leaves the former file.

    Raises:
        TrackingError: the file cannot be written.
    """
    text = json.dumps(value.model_dump(mode="json"), indent=1)
    write_atomically(text + "\n", path, fault)


def load_json(
    kind: type[Value], path: str | os.PathLike, fault: type[TrackingError], advice: str
) -> Value:
    """Read and validate a value.

    Args:
        kind: class of the value.
        path: the file.
        fault: class of the exception.
        advice: how to make such a file.

    Raises:
        TrackingError: there is no such file, or it is damaged.
    """
    if not Path(path).is_file():
        raise fault(f"there is no file {path}; {advice}")
    try:
        return kind.model_validate(json.loads(read_text(path, fault)))
    except ValidationError as error:
        heading = f"{path}: {{count}} fault(s)"
        raise fault(explained(error, heading, kind.model_fields)) from error
    except (ValueError, RecursionError) as error:
        raise fault(f"{path} is not valid JSON: {error}; {advice}") from error
