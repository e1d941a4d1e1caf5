"""Error beside speed: five arms at rest, simulated here and in PyElastica, against an independent rod."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from s2c2a.bench.extras import MissingExtraError, module_with
from s2c2a.bench.measurement import Measurement, Skipped, ratio, speed
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Progress, taken_in_turn
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot
from s2c2a.robots.simulation.rod_cases import RodCase, rod_cases

CHUNK = 0.1  # s of the arm's time, one control step of the cases' arms
TIMED = 20  # chunks of every case and engine, in turn; then each goes on alone until it rests
STILL, LONGEST = 1e-6, 400  # m that a tip at rest may still move in a chunk; chunks


@dataclass(frozen=True)
class ElasticaLayout:
    """How fine a rod in PyElastica is: elements, a time step [s] that is stable with them, and how stiff it is made."""

    elements: int
    time_step: float
    stiffer: float

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"PyElastica, {self.elements} elements, stretch x{self.stiffer:g}"


LAYOUTS = (ElasticaLayout(30, 4e-4, 1.0), ElasticaLayout(30, 1e-4, 25.0), ElasticaLayout(60, 5e-5, 25.0))


@dataclass
class _Engine:
    """One arm in one simulator: move on for a chunk, and tell where the tip is [m]."""

    advance: Callable[[int], object]
    tip: Callable[[], np.ndarray]

    def rest(self) -> np.ndarray:
        """Move on until the tip is still; where it is [m]."""
        before = self.tip()
        for number in range(LONGEST):
            self.advance(number)
            after = self.tip()
            if np.linalg.norm(after - before) < STILL:
                break
            before = after
        return before


@dataclass
class _Record:
    """What an engine did over the cases: seconds of every arm second [s], and errors at rest [m], case -> error."""

    seconds: list[np.ndarray]
    errors: dict[str, float]


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement | Skipped]:
    """All cases."""
    yield from rods(rod_cases(), LAYOUTS, TIMED, progress)


def rods(
    cases: Sequence[RodCase], layouts: Sequence[ElasticaLayout], chunks: int, progress: Progress
) -> Iterator[Measurement | Skipped]:
    """Speed of every engine on every case, chunk by chunk in turn, and its error at rest.

    Args:
        cases: arms under load.
        layouts: of the rods in PyElastica.
        chunks: of the arm's time that are timed.
        progress: told of every case.
    """
    try:
        room = module_with("elastica", "elastica")
    except MissingExtraError as missing:
        room, layouts = None, ()
        yield Skipped("the rod cases in PyElastica", str(missing))
    records: dict[str, _Record] = {}
    for case in cases:
        engines = {name: _ours(case, name) for name in FIDELITIES}
        engines |= {layout.name: _theirs(room, case, layout) for layout in layouts}
        told = partial(progress, f"rod case {case.name}")
        times = taken_in_turn({name: engine.advance for name, engine in engines.items()}, chunks, told)
        for name, engine in engines.items():
            record = records.setdefault(name, _Record([], {}))
            record.seconds.append(times[name] / CHUNK)
            record.errors[case.name] = float(np.linalg.norm(engine.rest() - case.tip))
    yield from _told(records)


def _told(records: dict[str, _Record]) -> Iterator[Measurement]:
    seconds = {name: np.concatenate(record.seconds) for name, record in records.items()}
    for name, record in records.items():
        each = ", ".join(f"{case} {1e3 * error:.2f}" for case, error in record.errors.items())
        yield speed(name, seconds[name], error=max(record.errors.values()), note=f"mm: {each}")
    for theirs, ours in product((name for name in records if name not in FIDELITIES), FIDELITIES):
        yield ratio(f"{ours} over {theirs}", seconds[theirs], seconds[ours])


def _ours(case: RodCase, fidelity: str) -> _Engine:
    robot = SimulatedRobot(case.arm, fidelity)
    robot.open()
    robot.push(case.tip_force)
    return _Engine(lambda _: robot.send(case.tensions), lambda: robot.states()[-1, :3])


def _theirs(room: Any, case: RodCase, layout: ElasticaLayout) -> _Engine:
    rod = room.ElasticaRod(case, layout.elements, layout.time_step, layout.stiffer)
    return _Engine(lambda _: rod.advance(CHUNK), lambda: rod.tip)
