"""Controllers: the learned C2A with its history, and inverse PCC."""

from abc import abstractmethod
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics import (
    PCC,
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.models import C2A, History
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY

Memory = Any  # a pytree of arrays


class Controller(eqx.Module):
    """A map from the desired and the sensed configuration to an action, with a memory of its own."""

    @abstractmethod
    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        """Memory at rest."""

    @abstractmethod
    def act(
        self,
        desired: Float[Array, "modules 3"],
        sensed: Float[Array, "modules 3"],
        memory: Memory,
    ):
        """The action [m or N], shape (modules, cables), and the memory after it."""

    @abstractmethod
    def sent(self, action: Float[Array, "modules cables"], memory: Memory) -> Memory:
        """Memory after an action [m or N] was sent in place of the last one, which a limit did not allow."""


class InversePCC(Controller):
    """Cables by inverse PCC: the comparison of the paper. No feedback.

    Attributes:
        pcc: the arm's map, with nominal numbers.
        gains: what each module's bend is multiplied by; ones for the plain map, shape
            (modules,).
    """

    pcc: PCC
    gains: Float[Array, " modules"]

    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        """Nothing to remember."""
        return ()

    def act(
        self,
        desired: Float[Array, "modules 3"],
        sensed: Float[Array, "modules 3"],
        memory: Memory,
    ):
        """See `Controller`."""
        return self.pcc.actions(
            bends_from_configurations(desired) * self.gains[:, None]
        ), memory

    def sent(self, action: Float[Array, "modules cables"], memory: Memory) -> Memory:
        """Nothing to remember."""
        return memory


class NetworkController(Controller):
    """C2A and its history (Chen et al. 2025, eq. (8)). At the start the first values fill the history."""

    network: C2A

    def start(self, sensed: Float[Array, "modules 3"]) -> History:
        """A history of rest."""
        modules, cables = self.network.sum_and_range.neutral.shape
        sensed_before = jnp.repeat(sensed[:, None], CONFIGURATION_HISTORY, axis=1)
        return History(sensed_before, jnp.zeros((modules, ACTION_HISTORY, cables)))

    def act(
        self,
        desired: Float[Array, "modules 3"],
        sensed: Float[Array, "modules 3"],
        memory: History,
    ):
        """See `Controller`."""
        history = History(_push(memory.configurations, sensed), memory.actions)
        action = self.network(desired, history)
        next_history = History(history.configurations, _push(history.actions, action))
        return self.network.sum_and_range.actions(action), next_history

    def sent(self, action: Float[Array, "modules cables"], memory: History) -> History:
        """The history holds what was really sent."""
        return memory._replace(
            actions=memory.actions.at[:, 0].set(
                self.network.sum_and_range.normalized(action)
            )
        )


class CorrectedMemory(NamedTuple):
    """What an integral correction carries.

    Attributes:
        inner: memory of the controller that is corrected.
        desired: bends desired in the last step [rad], shape (modules, 2).
        offset: added to what is desired [rad], shape (modules, 2).
    """

    inner: Memory
    desired: Float[Array, "modules 2"]
    offset: Float[Array, "modules 2"]


class CorrectedController(Controller):
    """Another controller, whose lasting errors are integrated and added to what is desired of it.

    Attributes:
        inner: the controller.
        gain: part of an error that is added in every step.
        largest: length at which a module's offset stops growing [rad].
    """

    inner: Controller
    gain: float
    largest: float = 0.1

    def start(self, sensed: Float[Array, "modules 3"]) -> CorrectedMemory:
        """At rest nothing is to be corrected."""
        bends = bends_from_configurations(sensed)
        return CorrectedMemory(self.inner.start(sensed), bends, jnp.zeros_like(bends))

    def act(
        self,
        desired: Float[Array, "modules 3"],
        sensed: Float[Array, "modules 3"],
        memory: CorrectedMemory,
    ):
        """See `Controller`."""
        missed = memory.desired - bends_from_configurations(sensed)
        offset = limit_lengths(memory.offset + self.gain * missed, self.largest)
        bends = bends_from_configurations(desired)
        action, inner = self.inner.act(
            configurations_from_bends(bends + offset), sensed, memory.inner
        )
        return action, CorrectedMemory(inner, bends, offset)

    def sent(
        self, action: Float[Array, "modules cables"], memory: CorrectedMemory
    ) -> CorrectedMemory:
        """See `Controller`."""
        return memory._replace(inner=self.inner.sent(action, memory.inner))


def _push(
    history: Float[Array, "modules ages features"],
    newest: Float[Array, "modules features"],
) -> Array:
    return jnp.concatenate([newest[:, None], history[:, :-1]], axis=1)
