"""Configuration maps: from measured values to configurations, without memory.

Readings are NumPy arrays; maps are functions of JAX arrays.
"""

from abc import abstractmethod
from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import PCC, configurations_from_bends, configurations_from_states
from s2c2a.models.arrays import Configurations
from s2c2a.plugins.components import Registry
from s2c2a.spaces import Reading

PAPER_COUPLING = ((0.85, 0.10, 0.05), (0.20, 0.70, 0.10), (0.15, 0.30, 0.55))
"""Coupling matrix of the sensors of three modules (Chen et al. 2025, eq. (11))."""

Measured = Mapping[str, Array | np.ndarray]


class ConfigurationMap(eqx.Module):
    """Map from measured values to configurations, of one reading or a recording.

    The arm file names it: `sensing = "encoders"`, or a custom class such as
    `sensing = "my_sensor.py:MyMap"`. Forward model and controller are trained on the
    resulting configurations.
    """

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Names of the required sensors."""

    @classmethod
    @abstractmethod
    def of(cls, arm: ArmSpec) -> "ConfigurationMap":
        """Build the map of an arm."""

    @abstractmethod
    def __call__(self, measured: Measured) -> Configurations:
        """Configurations, module frames, shape (*batch, modules, 3).

        Args:
            measured: sensor name -> values, with any batch axes before those of the
                sensor; traced JAX arrays.
        """

    def configurations(self, reading: Reading) -> Float[np.ndarray, "*batch modules 3"]:
        """Configurations of a reading, or of all readings of a recording.

        Raises:
            ReadingError: the reading lacks a sensor.
        """
        return np.asarray(self(self.inputs(reading)))

    def inputs(self, reading: Reading) -> dict[str, np.ndarray]:
        """The measured values that the map needs, in single precision.

        Raises:
            ReadingError: the reading lacks a sensor.
        """
        return {
            name: np.asarray(_measured(reading, name), np.float32)
            for name in self.sensors
        }


def _measured(reading: Reading, name: str) -> np.ndarray:
    """Values of a sensor; missing configurations are computed from true states."""
    if name == "configurations" and reading.get(name) is None:
        return configurations_from_states(np.asarray(reading["states"], float))
    return reading[name]


class EncoderMap(ConfigurationMap):
    """Configurations from cable displacements by PCC.

    Chen et al. 2025, eqs. (2), (3).
    """

    pcc: PCC
    sensors = ("cables",)

    @classmethod
    def of(cls, arm: ArmSpec) -> "ConfigurationMap":
        """See `ConfigurationMap`: with the arm's nominal geometry."""
        return cls(PCC.of(arm))

    def __call__(self, measured: Measured) -> Configurations:
        return configurations_from_bends(self.pcc.bends(measured["cables"]))


class TrueConfigurationMap(ConfigurationMap):
    """The true configurations, from simulation or motion capture."""

    sensors = ("configurations",)

    @classmethod
    def of(cls, arm: ArmSpec) -> "ConfigurationMap":
        return cls()

    def __call__(self, measured: Measured) -> Configurations:
        return jnp.asarray(measured["configurations"])


class WrappedMap(ConfigurationMap):
    """Map that changes the configurations of another map.

    Attributes:
        inner: the other map.
    """

    inner: ConfigurationMap

    @property
    def sensors(self) -> tuple[str, ...]:
        return self.inner.sensors

    @classmethod
    def of(cls, arm: ArmSpec) -> "ConfigurationMap":
        """Raise an error: the map requires an inner map.

        Raises:
            S2C2AError: always.
        """
        raise S2C2AError(f"{cls.__name__} wraps another map; name that one")


class CoupledMap(WrappedMap):
    """Linear mixture of the configurations of all modules.

    It models sensors that pass through several modules. The mixed vectors are shorter
    than one.

    Attributes:
        coupling: weights of the modules in each sensor, shape (modules, modules).
    """

    coupling: Float[Array, "modules modules"]

    def __call__(self, measured: Measured) -> Configurations:
        return jnp.einsum("ij,...jk->...ik", self.coupling, self.inner(measured))


class UnitLengthMap(WrappedMap):
    """Configurations of another map, scaled to unit length."""

    def __call__(self, measured: Measured) -> Configurations:
        configurations = self.inner(measured)
        lengths = jnp.linalg.norm(configurations, axis=-1, keepdims=True)
        return configurations / lengths


CONFIGURATION_MAPS: Registry[ConfigurationMap] = Registry(
    "sensor", ConfigurationMap, {"encoders": EncoderMap, "true": TrueConfigurationMap}
)
"""Built-in configuration maps by their names in `sensing` of an arm file."""


def configuration_map_for(arm: ArmSpec) -> ConfigurationMap:
    """The configuration map of an arm: `sensing`, then `sensing_coupling` if given.

    Raises:
        S2C2AError: no map of this name.
    """
    configuration_map = CONFIGURATION_MAPS.find(arm.sensing).of(arm)
    if arm.sensing_coupling is None:
        return configuration_map
    coupling = jnp.asarray(arm.sensing_coupling, dtype=jnp.float32)
    return CoupledMap(configuration_map, coupling)
