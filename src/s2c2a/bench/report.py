"""The report of a run: one file of JSON, whole after every line."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from s2c2a.bench.lines import Failed, Line, line_to_json, options_to_json
from s2c2a.bench.machine import describe, extra_versions
from s2c2a.bench.measurement import Growth, Measurement
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.parts import Part
from s2c2a.files import save_whole
from s2c2a.versions import versions

SCHEMA = 1


@dataclass
class Section:
    """What one part measured.

    Attributes:
        cores: that it was kept to.
        load_average: how busy the machine was when it began; beyond its idle cores, figures are too high.
        lines: as far as they are known.
    """

    cores: int
    load_average: float
    lines: list[Line] = field(default_factory=list)


@dataclass
class Report:
    """What was measured so far, with everything that it depends on.

    Attributes:
        path: the file.
        options: of all parts.
        machine: what it was measured on.
        sections: by the names of their parts.
    """

    path: Path
    options: BenchOptions
    machine: dict[str, Any] = field(default_factory=describe)
    sections: dict[str, Section] = field(default_factory=dict)

    def begin(self, part: Part) -> Section:
        """A part begins."""
        section = self.sections[part.name] = Section(part.cores, os.getloadavg()[0])
        self.save()
        return section

    def add(self, part: Part, line: Line) -> None:
        """One more line of a part."""
        self.sections[part.name].lines.append(line)
        self.save()

    def save(self) -> Path:
        """Write the file, whole or not at all.

        Raises:
            S2C2AError: it cannot be written.
        """
        return save_whole((json.dumps(self.as_json(), indent=1) + "\n").encode(), self.path)

    def as_json(self) -> dict[str, Any]:
        """Everything as plain values."""
        return {
            "schema": SCHEMA,
            "versions": versions() | extra_versions(),
            "machine": self.machine,
            "options": options_to_json(self.options),
            "seed": self.options.seed,
            "parts": {name: _section_to_json(section) for name, section in self.sections.items()},
        }

    @property
    def load(self) -> float:
        """How busy the machine was before anything was measured."""
        return float(self.machine["load_average"])

    def lines(self) -> Iterator[tuple[str, Line]]:
        """All lines, with the names of their parts."""
        for name, section in self.sections.items():
            yield from ((name, line) for line in section.lines)

    def growths(self) -> list[Growth]:
        """All growths that were measured."""
        return [line for _, line in self.lines() if isinstance(line, Growth)]

    def missed(self) -> list[str]:
        """What misses its limit."""
        return [
            f"{name}: {line.what}"
            for name, line in self.lines()
            if isinstance(line, Measurement) and line.kept is False
        ]

    def failed(self) -> list[str]:
        """Parts that could not go on."""
        return [name for name, line in self.lines() if isinstance(line, Failed)]


def _section_to_json(section: Section) -> dict[str, Any]:
    return vars(section) | {"lines": [_with_verdict(line) for line in section.lines]}


def _with_verdict(line: Line) -> dict[str, Any]:
    verdict = {"kept": line.kept} if isinstance(line, Measurement) and line.limit else {}
    return line_to_json(line) | verdict
