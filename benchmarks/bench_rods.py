"""Speed and error of five arms at rest, here and in PyElastica, against a rod model."""

from typing import NamedTuple

import numpy as np
import pytest

from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot

from driving import hold, module_with
from rod_cases import rod_cases

CHUNK = 0.1  # s of the arm's time, one control step of the cases' arms
TIMED = 20  # chunks of every case, in turn; then each goes on alone until it rests
# m that a tip at rest may still move in a chunk; chunks
STILL = 1e-6
LONGEST = 400


class Layout(NamedTuple):
    """Discretization in PyElastica: elements, stable time step [s], axial stiffness."""

    elements: int
    time_step: float
    stiffer: float


LAYOUTS = {
    "30 elements": Layout(30, 4e-4, 1.0),
    "30 elements, stretch x25": Layout(30, 1e-4, 25.0),
    "60 elements, stretch x25": Layout(60, 5e-5, 25.0),
}


class Ours:
    """A rod case in our simulation."""

    def __init__(self, case, fidelity: str):
        self._robot = SimulatedRobot(case.arm, fidelity)
        self._tensions = case.tensions
        self._robot.open()
        self._robot.apply_force(case.tip_force)

    def advance(self, seconds: float) -> None:
        hold(self._robot, self._tensions)

    @property
    def tip(self) -> np.ndarray:
        return self._robot.states()[-1, :3]


@pytest.mark.parametrize("case", rod_cases(), ids=lambda case: f"case {case.name}")
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_ours(benchmark, case, fidelity):
    engine = Ours(case, fidelity)
    benchmark.pedantic(engine.advance, args=(CHUNK,), rounds=TIMED, warmup_rounds=2)
    tell(benchmark, engine, case)


@pytest.mark.parametrize("case", rod_cases(), ids=lambda case: f"case {case.name}")
@pytest.mark.parametrize("layout", LAYOUTS)
def test_pyelastica(in_turn, benchmark, case, layout):
    engine = module_with("elastica", "elastica_rod").ElasticaRod(case, *LAYOUTS[layout])
    ours = Ours(case, "fast")
    in_turn(
        lambda: engine.advance(CHUNK),
        lambda: ours.advance(CHUNK),
        "our fast",
        rounds=TIMED,
    )
    assert tell(benchmark, engine, case) < 5e-3


def tell(benchmark, engine, case) -> float:
    """Simulated seconds a second, and the error of the tip at rest [m]."""
    if benchmark.stats:
        benchmark.extra_info["arm seconds a second"] = (
            CHUNK / benchmark.stats.stats.median
        )
    before = np.full(3, np.inf)
    after = engine.tip
    for _ in range(LONGEST):
        if np.linalg.norm(after - before) < STILL:
            break
        engine.advance(CHUNK)
        before = after
        after = engine.tip
    error = float(np.linalg.norm(after - case.tip))
    benchmark.extra_info["error at rest [mm]"] = 1e3 * error
    return error
