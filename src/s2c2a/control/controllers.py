"""Controllers from configurations to actions: learned C2A, inverse PCC, integrator."""

from abc import abstractmethod
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from s2c2a.kinematics import (
    PCC,
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.kinematics.pcc import Cables
from s2c2a.models import C2A, History
from s2c2a.models.arrays import Configuration, ModuleBends, PerModule
from s2c2a.paper import pushed

Memory = Any  # a pytree of arrays


class Controller(eqx.Module):
    """Maps desired and sensed configurations to an action.

    A controller has no state of its own; the caller passes its memory.
    """

    @abstractmethod
    def start(self, sensed: Configuration) -> Memory:
        """Memory of an arm at rest."""

    @abstractmethod
    def act(self, desired: Configuration, sensed: Configuration, memory: Memory):
        """The next action.

        Args:
            desired: desired configurations, shape (modules, 3), module frames.
            sensed: sensed configurations, shape (modules, 3), module frames.
            memory: memory after the last action.

        Returns:
            The action [m or N], shape (modules, cables), and the next memory.
        """

    @abstractmethod
    def sent(self, action: Cables, memory: Memory) -> Memory:
        """Memory after a limit changed the last action.

        Args:
            action: action that was sent instead [m or N], shape (modules, cables).
            memory: memory after the last action.
        """


class InversePCC(Controller):
    """Inverse PCC without feedback, the baseline of the paper.

    Attributes:
        pcc: piecewise constant curvature map with nominal parameters.
        gains: factor of each module's bend; ones for the plain map, shape (modules,).
    """

    pcc: PCC
    gains: PerModule

    def start(self, sensed: Configuration) -> Memory:
        """See `Controller`: the memory is empty."""
        return ()

    def act(self, desired: Configuration, sensed: Configuration, memory: Memory):
        bends = bends_from_configurations(desired) * self.gains[:, None]
        return self.pcc.actions(bends), memory

    def sent(self, action: Cables, memory: Memory) -> Memory:
        """See `Controller`: the memory is empty."""
        return memory


class NetworkController(Controller):
    """C2A with its history (Chen et al. 2025, eq. (8)).

    The first sensed configurations and the neutral action fill the initial history.
    """

    network: C2A

    def start(self, sensed: Configuration) -> History:
        """See `Controller`: the history of an arm at rest."""
        _, cables = self.network.sum_and_range.neutral.shape
        return History.at_rest(sensed, cables)

    def act(self, desired: Configuration, sensed: Configuration, memory: History):
        history = History(pushed(memory.configurations, sensed), memory.actions)
        action = self.network(desired, history)
        next_history = History(history.configurations, pushed(history.actions, action))
        return self.network.sum_and_range.actions(action), next_history

    def sent(self, action: Cables, memory: History) -> History:
        """See `Controller`: the history with the action that was sent."""
        normalized = self.network.sum_and_range.normalized(action)
        return memory._replace(actions=memory.actions.at[:, 0].set(normalized))


class CorrectedMemory(NamedTuple):
    """Memory of a controller with integral correction.

    Attributes:
        inner: memory of the inner controller.
        desired: desired bends of the last step [rad], shape (modules, 2).
        offset: integral added to the desired bends [rad], shape (modules, 2).
    """

    inner: Memory
    desired: ModuleBends
    offset: ModuleBends


class CorrectedController(Controller):
    """A controller with integral feedback on the bend error.

    Attributes:
        inner: the controller; the integral is added to its desired bends.
        gain: share of the error added in every step.
        largest: limit of the integral of each module [rad], against windup.
    """

    inner: Controller
    gain: float
    largest: float = 0.1

    def start(self, sensed: Configuration) -> CorrectedMemory:
        """See `Controller`: the integral is zero."""
        bends = bends_from_configurations(sensed)
        return CorrectedMemory(self.inner.start(sensed), bends, jnp.zeros_like(bends))

    def act(
        self, desired: Configuration, sensed: Configuration, memory: CorrectedMemory
    ):
        error = memory.desired - bends_from_configurations(sensed)
        offset = limit_lengths(memory.offset + self.gain * error, self.largest)
        bends = bends_from_configurations(desired)
        corrected = configurations_from_bends(bends + offset)
        action, inner = self.inner.act(corrected, sensed, memory.inner)
        return action, CorrectedMemory(inner, bends, offset)

    def sent(self, action: Cables, memory: CorrectedMemory) -> CorrectedMemory:
        return memory._replace(inner=self.inner.sent(action, memory.inner))
