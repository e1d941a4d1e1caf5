"""What planners in bends share: bends of the encoders in, cables of ideal arcs out.

A planner chooses the next bends of all modules. Everything else is that of the strategy
`pcc`, so that a comparison shows the planners alone.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.estimation import EncoderEstimator, EncoderMap, Estimate
from s2c2a.execution.compilation import compiled
from s2c2a.goals import Goal
from s2c2a.kinematics import (
    PCC,
    bends_from_configurations,
    commanded_part,
    configurations_from_bends,
)
from s2c2a.planning import Guard
from s2c2a.spaces import POSITION, Actions, Reading
from s2c2a.strategies import Recipe, RunOptions, StrategyOptions, TrainedNetworks

Bends = Float[np.ndarray, "modules 2"]
States = Float[np.ndarray, "modules 6"]
TINY = 1e-12  # rad; a vector without a direction


class Moment(NamedTuple):
    """What a planner knows in a control step.

    Attributes:
        bends: that were planned last, as limits left them [rad], shape (modules, 2),
            module frames.
        sensed: bends by the encoders [rad], of the same shape.
        seen: true states [m, 1], shape (modules, 6), base frame; None unless the
            planner sees them.
    """

    bends: Bends
    sensed: Bends
    seen: States | None

    @property
    def tip(self) -> Float[np.ndarray, "3"]:
        """Seen position of the tip [m], base frame.

        Raises:
            StrategyError: the planner does not see states.
        """
        if self.seen is None:
            raise StrategyError("this planner does not see the tip; pass sees_states")
        return self.seen[-1, POSITION]


class BendPlanner(Protocol):
    """Plans the bends of the next control step; its memory is its own."""

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Bends [rad] for the end of the next step, within any limits."""


@dataclass(frozen=True)
class BendPlanning(StrategyOptions):
    """A strategy without training, whose planner chooses bends.

    Attributes:
        sees_states: whether the planner sees the true states, as under motion capture.
    """

    recipe_keys = frozenset()
    sees_states: ClassVar[bool] = False

    @abstractmethod
    def planner(self, arm: ArmSpec, guard: Guard) -> BendPlanner:
        """Compile the planner for an arm.

        Args:
            arm: that it leads.
            guard: points that keep clear of obstacles, where it knows them.
        """

    def build(
        self,
        arm: ArmSpec,
        recipe: Recipe,
        trained: TrainedNetworks | None,
        run: RunOptions,
    ) -> "ArcDriver":
        planner = self.planner(arm, run.guard)
        return ArcDriver(self.name, arm, planner, self.sees_states)


class ArcDriver:
    """A driver of the control loop that a planner in bends leads.

    Attributes:
        name: of the strategy.
        arm: that it drives.
        sensors: names of the sensors that every reading must hold.
    """

    def __init__(
        self, name: str, arm: ArmSpec, planner: BendPlanner, sees_states: bool = False
    ):
        """Compile for an arm.

        Args:
            name: of the strategy.
            arm: that it drives.
            planner: chooses the next bends.
            sees_states: whether it sees the true states, as under motion capture.
        """
        self.name = name
        self.arm = arm
        self._planner = planner
        self._sees_states = sees_states
        pcc = PCC.of(arm)
        self._estimator = EncoderEstimator(EncoderMap(pcc))
        self.sensors = tuple(self._estimator.sensors)
        if sees_states:
            self.sensors += ("states",)
        self._within_limits = partial(_within_limits, ArmGeometry.of(arm))
        self._actions = compiled(PCC.actions, pcc)
        self._bends_of = compiled(PCC.bends, pcc)
        self._sensed_bends = compiled(bends_from_configurations)
        self._configurations = compiled(configurations_from_bends)
        self._moment: Moment
        # compile everything: no control step waits for it
        rest = ArmGeometry.of(self.arm).action_neutral
        reading = Reading(0.0, {"cables": rest})
        estimate = self._estimator.start(reading)
        estimate = self._estimator.update(estimate, reading, rest)
        bends = self._within_limits(self._bends(estimate), self._bends(estimate))
        self._actions(bends)
        self._bends_of(np.asarray(rest, np.float32))
        self._configurations(bends)

    def start(self, reading: Reading) -> None:
        """Begin with an arm at rest."""
        self._estimate = self._estimator.start(reading)
        sensed = self._bends(self._estimate)
        seen = self._states(reading)
        self._moment = Moment(sensed, sensed, seen)
        self._planner.start(self._moment)

    def estimate(self, reading: Reading, last_command: Actions) -> Estimate:
        """Bends by the encoders, and the true states if the planner sees them."""
        self._estimate = self._estimator.update(self._estimate, reading, last_command)
        sensed = self._bends(self._estimate)
        seen = self._states(reading)
        self._moment = self._moment._replace(sensed=sensed, seen=seen)
        return self._estimate

    def plan(self, estimate: Estimate, goal: Goal) -> Bends:
        """The next bends [rad], within the limits of the arm."""
        last = self._moment.bends
        planned = self._planner.next_bends(self._moment, goal)
        wanted = np.asarray(planned, np.float32)
        if not np.isfinite(wanted).all():
            wanted = last
        bends = np.asarray(self._within_limits(wanted, last))
        self._moment = self._moment._replace(bends=bends)
        return bends

    def act(self, plan: Bends, estimate: Estimate) -> Actions:
        """The command that bends ideal arcs so [m or N], shape (modules, cables)."""
        return np.asarray(self._actions(plan), float)

    def sent(self, action: Actions) -> None:
        """Go on from the bends of the command that was sent instead."""
        command = np.asarray(action, np.float32)
        bends = np.asarray(self._bends_of(command))
        self._moment = self._moment._replace(bends=bends)

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Sensed and planned configurations, shape (modules, 3)."""
        return {
            "sensed": np.asarray(self._estimate.configuration),
            "planned": np.asarray(self._configurations(self._moment.bends)),
        }

    def _bends(self, estimate: Estimate) -> Bends:
        configuration = np.asarray(estimate.configuration, np.float32)
        bends = self._sensed_bends(configuration)
        return np.asarray(bends)

    def _states(self, reading: Reading) -> States | None:
        if not self._sees_states:
            return None
        return reading.sensors["states"]


def _within_limits(geometry: ArmGeometry, wanted: Bends, last: Bends) -> Bends:
    """Bends nearest to the wanted ones that the arm can have in the next step."""
    step = _shortened(wanted - last, geometry.step_limit)
    bends = _shortened(last + step, geometry.planned_bends)
    if geometry.steerable is None:
        return bends
    commanded = commanded_part(bends, geometry.steerable)
    return np.asarray(commanded)


def _shortened(vectors: Bends, lengths: Float[np.ndarray, " modules"] | float) -> Bends:
    sizes = np.linalg.norm(vectors, axis=-1)
    sizes = np.maximum(sizes, TINY)
    shares = np.minimum(1.0, lengths / sizes)
    return vectors * shares[:, None]
