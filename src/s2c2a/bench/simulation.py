"""Simulating the arm: arm seconds in a second, by fidelity and threads, its error at rest beside it."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.bench.measurement import Limit, Measurement, ratio, speed
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Progress, taken_in_turn
from s2c2a.data import episode_actions
from s2c2a.experiments.simulator_accuracy import static_errors
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot
from s2c2a.shards import all_cores

LIMITS = {"fast": Limit(250.0, at_least=True), "accurate": Limit(25.0, at_least=True)}
STEPS = {"fast": 200, "accurate": 40}  # control steps a repeat and thread
ROUNDS = 4  # repeats for every long one

Actions = Float[np.ndarray, "steps modules cables"]


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement]:
    """Every fidelity on one thread and on every core, in turn."""
    errors = worst_errors()
    yield from speeds(options, errors, partial(progress, "simulating"))


def worst_errors() -> dict[str, float]:
    """Largest distance of the tip at rest from the rod's over its five cases [m], fidelity -> error."""
    errors = static_errors()
    return {name: max(each.error for each in errors if each.fidelity == name) for name in FIDELITIES}


def speeds(
    options: BenchOptions, errors: dict[str, float], progress: Callable[[int, int], None]
) -> Iterator[Measurement]:
    """Arm seconds in a second while the arm babbles."""
    arm, crowds = options.arm, sorted({1, all_cores()})
    with ThreadPoolExecutor(max(crowds)) as pool:
        crews = {
            (fidelity, threads): _Crew(arm, fidelity, threads, options.seed, pool)
            for fidelity, threads in product(FIDELITIES, crowds)
        }
        calls = {f"{fidelity}, {threads} thread(s)": crew.work for (fidelity, threads), crew in crews.items()}
        times = taken_in_turn(calls, ROUNDS * options.long_repeats, progress)
    took = {key: seconds / crew.arm_seconds for (key, crew), seconds in zip(crews.items(), times.values(), strict=True)}
    for (fidelity, threads), seconds in took.items():
        limit = LIMITS.get(fidelity) if threads == 1 else None
        yield speed(f"{fidelity}, {threads} thread(s)", seconds, limit, errors[fidelity])
    for fidelity in FIDELITIES if len(crowds) > 1 else ():
        one, all_of_them = (took[fidelity, threads] for threads in crowds)
        yield ratio(f"{fidelity}: {crowds[-1]} threads over one", one, all_of_them)


class _Crew:
    """Arms that are simulated side by side, one a thread, each on a babble of its own that begins anew with each call.

    Attributes:
        arm_seconds: simulated in every call [s].
    """

    def __init__(self, arm: ArmSpec, fidelity: str, threads: int, seed: int, pool: ThreadPoolExecutor):
        steps, geometry = STEPS[fidelity], ArmGeometry.of(arm)
        self._babbles = [episode_actions(geometry, "motor", number, threads, steps, seed) for number in range(threads)]
        self._robots = [SimulatedRobot(arm, fidelity, number) for number in range(threads)]
        for robot in self._robots:
            robot.open()
        self._pool = pool
        self.arm_seconds = threads * steps * arm.control_period

    def work(self, number: int) -> None:
        """Simulate all arms for the babble."""
        if len(self._robots) == 1:
            _send_all(self._robots[0], self._babbles[0])
            return
        list(self._pool.map(_send_all, self._robots, self._babbles))


def _send_all(robot: SimulatedRobot, actions: Actions) -> None:
    for action in actions:
        robot.send(action)
