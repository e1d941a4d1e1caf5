"""MCAP files with JSON messages, as Foxglove's tools write them: one topic is one table.

Messages of ROS are read by `bags`.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from s2c2a.logs.bags import NANOSECOND, TIME, read_bag, table_of_rows
from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, LogError, needs_extra, reading_as
from s2c2a.logs.json_lines import leaves
from s2c2a.logs.tables import ColumnRequest, Table, list_names

MAX_MESSAGE_BYTES = 1_000_000  # 4096 numbers in full precision have 100,000

JSON = "json"


def read_mcap(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read one topic: JSON messages here, those of ROS as a bag.

    Fields are named `pose.x` and `position.0`; `time` is that of the log [s].

    Raises:
        LogError: an extra is missing, the file cannot be read or is too large, the
            topic is not one of its own, or its messages have another encoding.
    """
    with needs_extra(path, "MCAP"):
        import mcap  # noqa: F401, PLC0415  # an extra
    with reading_as(path, "MCAP", "check that it is complete (`mcap doctor`)"):
        encodings = {
            record.topic: record.message_encoding
            for record in _records(Path(path))
            if hasattr(record, "message_encoding")
        }
    if "cdr" in encodings.values() or not encodings:
        return read_bag(path, request)
    topic = _topic_of(path, encodings, request.topic)
    with reading_as(path, "MCAP", "check that it is complete (`mcap doctor`)"):
        return table_of_rows(path, _rows_of(Path(path), topic), request)


def _topic_of(
    path: str | os.PathLike, encodings: dict[str, str], wanted: str | None
) -> str:
    readable = sorted(name for name, each in encodings.items() if each == JSON)
    if wanted is None and len(readable) == 1:
        return readable[0]
    if wanted in readable:
        return wanted
    given = "no topic" if wanted is None else f"'{wanted}'"
    if wanted in encodings:
        given += f", whose messages are {encodings[wanted]:.20}"
    raise LogError(
        f"{path}: the map names {given}; set rows.topic to one with JSON messages: "
        f"{list_names(readable)}"
    )


def _rows_of(path: Path, topic: str) -> Iterator[dict[str, float]]:
    """The numbers of every message of a topic, by their names."""
    channels = set()
    for record in _records(path):
        if getattr(record, "topic", None) == topic:
            channels.add(record.id)
        elif getattr(record, "channel_id", None) in channels and hasattr(
            record, "data"
        ):
            # a message; a long one is refused before it takes a hundred times its size
            data = record.data
            if len(data) > MAX_MESSAGE_BYTES:
                raise LogError(
                    f"a message has {len(data)} bytes; at most {MAX_MESSAGE_BYTES} are read. "
                    "Choose a topic of numbers"
                )
            row = dict(_numbers(json.loads(data)))
            yield row | {TIME: record.log_time * NANOSECOND}


def _numbers(message: Any) -> Iterator[tuple[str, float]]:
    """Name and value of each number of a message; missing numbers are null."""
    for count, (name, value) in enumerate(leaves(message)):
        if count > MAX_COLUMNS:
            raise LogError(
                f"a message has more than {MAX_COLUMNS} values; choose a topic of "
                "numbers"
            )
        if value is None:
            yield name, float("nan")
        elif isinstance(value, int | float):
            yield name, float(value)


def _records(path: Path) -> Iterator[Any]:
    """Records of a file, those in chunks among them.

    Raises:
        LogError: the file ends early.
    """
    from mcap.exceptions import EndOfFile  # noqa: PLC0415  # an extra
    from mcap.stream_reader import StreamReader  # noqa: PLC0415  # an extra

    whole = 0
    with open(path, "rb") as file:
        try:
            for record in StreamReader(file, record_size_limit=MAX_BYTES).records:
                whole += hasattr(record, "log_time")
                yield record
        except EndOfFile as error:
            raise LogError(
                f"{path} is cut off: it ends after {whole} whole messages; copy it again, "
                "or save these with `mcap recover`"
            ) from error
