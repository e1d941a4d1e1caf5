"""Sensors whose numbers nobody can say beforehand: what they have to do with bends is learned from a recording.

Flex sensors, each of which errs in its own way, and whatever else a body has
(`[[sensors.raw]]` in the arm file).
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.estimation.sensors import Off, Said, Sense, Shape, Zeros, with_slopes
from s2c2a.models.layers import Scaling
from s2c2a.training.fit import Fixed

PREFIX = "sensors."
"""Of what is learned of a sensor, among a strategy's networks."""
HIDDEN = 24
DEPTH = 2
DOUBT = 6.0
UNSTEADY = 12.0
"""What spreads and wanderings are multiplied by: what is left of a recording is no
white noise but comes and goes with how the arm moves, and would be believed as leans
(docs/sensors.md)."""


class Errors(Fixed):
    """By how much a sensor's numbers are off what is learned of them, in its own units.

    Attributes:
        spread: standard deviation of what comes and goes, shape (numbers,).
        first: standard deviation of zeros when the arm is opened, shape (numbers,).
        wander: standard deviation of their change in a second, shape (numbers,).
        play: by how much they stay behind, either way, whenever bends turn back, shape
            (numbers,).
    """

    spread: Float[Array, " numbers"]
    first: Float[Array, " numbers"]
    wander: Float[Array, " numbers"]
    play: Float[Array, " numbers"]


class LearnedNumbers(eqx.Module):
    """What a sensor says of an arm that is bent so, however many numbers that are.

    Attributes:
        network: from bends [rad] to numbers in units.
        scaling: to units.
        errors: of what is said.
    """

    network: eqx.nn.MLP
    scaling: Scaling
    errors: Errors

    @classmethod
    def untrained(
        cls, arm: ArmSpec, numbers: int, key: PRNGKeyArray
    ) -> "LearnedNumbers":
        """Before anything is learned."""
        network = eqx.nn.MLP(
            2 * arm.module_count, numbers, HIDDEN, DEPTH, jax.nn.tanh, key=key
        )
        return cls(network, Scaling.identity(numbers), Errors(*[jnp.ones(numbers)] * 4))

    def __call__(self, bends: Float[Array, " bends"]) -> Float[Array, " numbers"]:
        """In the sensor's own units."""
        return self.scaling.back(self.network(bends))


class LearnedSense(Sense):
    """A sensor of a body's own, or of a kind that has to be learned.

    It says at once how the arm bends, as well as it was learned; its zero is found
    while it works.

    Attributes:
        name: in readings.
        shape: of what it says.
        numbers: that are learned of it.
    """

    name: str = eqx.field(static=True)  # type: ignore[misc] # each has its own
    shape: tuple[int, ...] = eqx.field(static=True)
    numbers: LearnedNumbers

    @property
    def zeros(self) -> Zeros:
        """See `Sense`."""
        return Zeros(self.numbers.errors.first, UNSTEADY * self.numbers.errors.wander)

    def lagging(self, bends: Float[Array, "modules 2"]) -> Array:
        """See `Sense`."""
        return self.numbers(bends.reshape(-1))

    def off(self, said: Said, shape: Shape) -> Off:
        """See `Sense`; slopes are those while it follows."""
        expected, slopes = with_slopes(self.numbers, shape.bends)
        errors = self.numbers.errors
        lagging = jnp.clip(
            shape.lagging, expected - errors.play, expected + errors.play
        )
        return Off(
            said[self.name].reshape(-1) - lagging,
            slopes,
            DOUBT * errors.spread,
            np.inf,
            lagging,
        )

    def silent(self) -> dict[str, np.ndarray]:
        """See `Sense`."""
        return {self.name: np.full(self.shape, np.nan, np.float32)}


def untrained_sensors(arm: ArmSpec, key: PRNGKeyArray) -> dict[str, LearnedNumbers]:
    """Those of an arm before anything is learned, by `PREFIX` and name."""
    shapes = arm.sensors.learned_shapes(arm.module_count)
    return {
        f"{PREFIX}{name}": LearnedNumbers.untrained(arm, int(np.prod(shape)), key)
        for name, shape in shapes.items()
    }


def learned_sensors(
    arm: ArmSpec, networks: Mapping[str, eqx.Module]
) -> tuple[LearnedSense, ...]:
    """Sensors that an arm lists, and of which its networks have learned; others say nothing to them.

    Args:
        arm: the arm.
        networks: of a strategy, by name.
    """
    shapes = arm.sensors.learned_shapes(arm.module_count)
    found = (
        (name, shape, networks.get(f"{PREFIX}{name}")) for name, shape in shapes.items()
    )
    return tuple(
        LearnedSense(name, shape, numbers)
        for name, shape, numbers in found
        if isinstance(numbers, LearnedNumbers)
        and len(numbers.errors.spread) == np.prod(shape)
    )
