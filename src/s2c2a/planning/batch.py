"""Offline planning in batches: many goals at once.

The work is split into padded chunks of one size, on several threads. Another batch size
therefore compiles nothing anew, and results do not depend on the number of threads.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import TargetError
from s2c2a.estimation import ModalFactors
from s2c2a.execution.compilation import compiled
from s2c2a.execution.executors import all_cores, validated_worker_count
from s2c2a.goals import Goal
from s2c2a.kinematics.bends import Numbers
from s2c2a.models.forward_model import ForwardModel
from s2c2a.planning.planner import Plan, PlannerOptions, Step

CHUNK = 64  # plans in one call, of which `benchmarks/bench_batch.py` takes the time


class BatchPlanner:
    """Plans many goals at once; each program compiles once, when it is first needed.

    The next step starts from what was planned, so paths are those of an arm that
    follows its plan exactly.
    """

    def __init__(
        self,
        arm: ArmSpec,
        model: ForwardModel,
        options: PlannerOptions,
        chunk: int = CHUNK,
        threads: int | None = None,
        factors: ModalFactors | None = None,
    ):
        """Prepare for an arm and a forward model; nothing compiles yet.

        Args:
            arm: its limits hold.
            model: predicts states.
            options: of the planner.
            chunk: plans in one call; larger chunks suit a GPU.
            threads: chunks at the same time; all cores by default.
            factors: of the arm's stiffness and damping; nominal ones by default.

        Raises:
            S2C2AError: the chunk or the number of threads is below one.
        """
        if chunk < 1:
            raise TargetError(f"chunks of {chunk} were requested; give at least 1")
        self._chunk = chunk
        self._threads = validated_worker_count(threads, all_cores)
        step = Step.of(arm, model, options, factors)
        self._start = compiled(_vectorize, Step.started, step)
        self._next = compiled(_vectorize, Step.next_plan, step)

    def start(self, sensed: Float[Numbers, "batch modules 3"]) -> Plan:
        """Plans of arms at rest, with the batch axis first in every array.

        Raises:
            TargetError: the batch is empty, or a configuration is not finite.
        """
        configurations = np.asarray(sensed, np.float32)
        if not len(configurations) or not np.isfinite(configurations).all():
            raise TargetError(
                f"configurations of shape {configurations.shape} are empty or not "
                "finite; give at least one, all finite"
            )
        return self._in_chunks(self._start, self._chunk, configurations)

    def plan(
        self, plans: Plan, sensed: Float[Numbers, "batch modules 3"], goals: Goal
    ) -> Plan:
        """The next plan of each arm, towards its own goal.

        Args:
            plans: the last plans.
            sensed: latest sensed configurations, shape (batch, modules, 3).
            goals: with the batch axis first (`Goal.stacked`).

        Raises:
            TargetError: the numbers of plans, arms and goals differ.
        """
        counts = len(plans.configurations), len(sensed), len(goals.positions)
        if len(set(counts)) > 1:
            raise TargetError(
                "{} plans, {} sensed arms and {} goals given; "
                "give as many of each".format(*counts)
            )
        sensed = np.asarray(sensed, np.float32)
        if (np.asarray(goals.thresholds) > 0).any():
            return self._in_chunks(self._next, self._chunk, plans, sensed, goals)
        unobstructed = goals.with_rows(slice(0))
        return self._in_chunks(self._next, self._chunk, plans, sensed, unobstructed)

    def _in_chunks(self, program: Callable[..., Any], size: int, *inputs: Any) -> Any:
        """Run a program over all chunks on threads; concatenate the results."""
        inputs = jax.tree.map(np.asarray, inputs)
        count = len(jax.tree.leaves(inputs)[0])

        def run_chunk(begin: int):
            return jax.tree.map(np.asarray, program(*_slice(inputs, begin, size)))

        with ThreadPoolExecutor(self._threads) as pool:
            results = list(pool.map(run_chunk, range(0, count, size)))
        return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *results)


def _slice(inputs: Any, begin: int, size: int) -> Any:
    """One chunk; the last chunk is padded with its last row."""
    last = len(jax.tree.leaves(inputs)[0]) - 1
    rows = np.minimum(np.arange(begin, begin + size), last)
    return jax.tree.map(lambda values: np.asarray(values)[rows], inputs)


def _vectorize(function: Callable[..., Any], step: Step, *inputs: Any) -> Any:
    return jax.vmap(partial(function, step))(*inputs)
