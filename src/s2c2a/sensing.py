"""Estimators: from readings to rough configurations, as far as sensors can tell. Here NumPy turns into JAX."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.plugins import found
from s2c2a.kinematics import PCC, configurations_from_bends, configurations_from_states
from s2c2a.spaces import Reading

PAPER_COUPLING = ((0.85, 0.10, 0.05), (0.20, 0.70, 0.10), (0.15, 0.30, 0.55))
"""How the configurations of three modules leak into each other's sensors (Chen et al.
2025, eq. (11))."""

Sensors = Mapping[str, Array | np.ndarray]
Sensed = Float[Array, "*batch modules 3"]


class Estimator(eqx.Module):
    """A map from what was measured to configurations, for one moment or a whole recording.

    One of your own is named in the arm file (`sensing = "my_sensor.py:MyEstimator"`)
    and built by `of`.
    """

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that it needs."""

    @classmethod
    @abstractmethod
    def of(cls, arm: ArmSpec) -> Self:
        """The estimator for an arm."""

    @abstractmethod
    def __call__(self, sensors: Sensors) -> Sensed:
        """Sensed configurations, shape (*batch, modules, 3), module frames.

        Args:
            sensors: name -> numbers, each of its declared shape after any batch; they
                are JAX's, traced.
        """

    def sensed(self, reading: Reading) -> np.ndarray:
        """Sensed configurations in a reading, or in all those of a recording, shape (*batch, modules, 3)."""
        return np.asarray(self(self.inputs(reading)))

    def inputs(self, reading: Reading) -> dict[str, np.ndarray]:
        """What it needs of a reading, in single precision; of states alone, configurations follow.

        Raises:
            ReadingError: it is not there.
        """
        return {
            name: np.asarray(_said(reading, name), np.float32) for name in self.sensors
        }


def _said(reading: Reading, name: str) -> np.ndarray:
    if name == "configurations" and reading.get(name) is None:
        return configurations_from_states(np.asarray(reading["states"], float))
    return reading[name]


class EncoderEstimator(Estimator):
    """Configurations from the cables' readings through PCC (Chen et al. 2025, eqs. (2) and (3))."""

    pcc: PCC
    sensors = ("cables",)

    @classmethod
    def of(cls, arm: ArmSpec) -> Self:
        """With the arm's nominal numbers."""
        return cls(PCC.of(arm))

    def __call__(self, sensors: Sensors) -> Sensed:
        """See `Estimator`."""
        return configurations_from_bends(self.pcc.bends(sensors["cables"]))


class TrueEstimator(Estimator):
    """The true configurations: simulation, or a real arm under motion capture."""

    sensors = ("configurations",)

    @classmethod
    def of(cls, arm: ArmSpec) -> Self:
        """The same for every arm."""
        return cls()

    def __call__(self, sensors: Sensors) -> Sensed:
        """See `Estimator`."""
        return jnp.asarray(sensors["configurations"])


class Wrapped(Estimator):
    """Another estimator's configurations, changed."""

    inner: Estimator

    @property
    def sensors(self) -> tuple[str, ...]:
        """Those of the other one."""
        return self.inner.sensors

    @classmethod
    def of(cls, arm: ArmSpec) -> Self:
        """Not from an arm alone."""
        raise S2C2AError(f"{cls.__name__} goes round another estimator; name that one")


class CoupledEstimator(Wrapped):
    """Another estimator's configurations, mixed between modules: sensors that pass through the whole arm.

    The mixed vectors are shorter than one.
    """

    coupling: Float[Array, "modules modules"]

    def __call__(self, sensors: Sensors) -> Sensed:
        """See `Estimator`."""
        return jnp.einsum("ij,...jk->...ik", self.coupling, self.inner(sensors))


class DirectionEstimator(Wrapped):
    """Another estimator's configurations at unit length, whatever mixes them: two numbers a module, as in a bend."""

    def __call__(self, sensors: Sensors) -> Sensed:
        """See `Estimator`."""
        sensed = self.inner(sensors)
        return sensed / jnp.linalg.norm(sensed, axis=-1, keepdims=True)


ESTIMATORS: dict[str, type[Estimator]] = {
    "encoders": EncoderEstimator,
    "true": TrueEstimator,
}
"""What `sensing` in an arm file can be, beside estimators of your own."""


def estimator_for(arm: ArmSpec) -> Estimator:
    """The estimator that an arm file asks for: its `sensing`, under its `sensing_coupling` if it has one.

    Raises:
        S2C2AError: no such estimator.
    """
    kind = found("sensor", arm.sensing, ESTIMATORS)
    if not (isinstance(kind, type) and issubclass(kind, Estimator)):
        raise S2C2AError(
            f"sensing = '{arm.sensing}' is {kind!r}, no subclass of s2c2a.sensing.Estimator"
        )
    estimator = kind.of(arm)
    if arm.sensing_coupling is None:
        return estimator
    return CoupledEstimator(
        estimator, jnp.asarray(arm.sensing_coupling, dtype=jnp.float32)
    )
