"""Simulated flex sensors: low-cost resistive strips along the modules."""

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.arm.backlash import play
from s2c2a.arm.geometry import directions_at
from s2c2a.arm.sensors import Flex
from s2c2a.kinematics import configurations_from_states
from s2c2a.robots.simulation.random_streams import Stream, random_stream
from s2c2a.spaces import States


class FlexStrips:
    """Flex sensors with hysteresis, crosstalk, a nonlinear gain and a drifting bias.

    A strip at angle a of a module with bend b is bent by u = b_x cos a + b_y sin a,
    plus crosstalk from other modules. It measures g v (1 + c v) + z with its own gain g
    and nonlinearity c, a drifting bias z, and v, which follows u with backlash because
    the strip creeps in its glue.
    """

    def __init__(self, arm: ArmSpec, flex: Flex, seed: int, opening: int):
        """Create the strips, the same at every opening, and sample new biases."""
        modules = arm.module_count
        shape = (modules, len(flex.angles_deg))
        random = random_stream(flex.strips, Stream.FLEX_STRIPS)
        angle_errors = random.normal(scale=np.deg2rad(flex.angle_error_deg), size=shape)
        angles = np.deg2rad(flex.angles_deg) + angle_errors
        self._gains = 1.0 + random.normal(scale=flex.gain_error, size=shape)
        self._nonlinearities = random.normal(scale=flex.nonlinearity, size=shape)
        crosstalk = random.normal(scale=flex.crosstalk, size=(*shape, modules))
        own_module = np.eye(modules)[:, None]
        shares = crosstalk * (1.0 - own_module) + own_module
        directions = directions_at(angles)
        # (modules, strips, modules that bend them, 2)
        self._bend_gains = shares[..., None] * directions[:, :, None]
        self._flex = flex
        self._random = random_stream(seed, Stream.FLEX_NOISE, opening)
        self._biases = self._random.normal(scale=flex.zero_error, size=shape)
        self._strip_bends = np.zeros(shape)
        self._noise = np.zeros(shape)

    def bend(self, states: States, seconds: float) -> None:
        """Bend the strips with the modules, `seconds` after the last call."""
        flex = self._flex
        configurations = configurations_from_states(states)
        lateral = np.linalg.norm(configurations[:, :2], axis=-1, keepdims=True)
        angles = np.arctan2(lateral, configurations[:, 2:])
        sizes = np.maximum(lateral, np.finfo(float).tiny)
        module_bends = configurations[:, :2] * angles / sizes
        bends = np.einsum("mskc,kc->ms", self._bend_gains, module_bends)
        self._strip_bends = play(
            self._strip_bends, bends - flex.hysteresis, bends + flex.hysteresis
        )
        drift, noise = self._random.normal(size=(2, *bends.shape))
        # the drift is that of a minute
        self._biases = self._biases + flex.drift * np.sqrt(seconds / 60) * drift
        self._noise = flex.noise * noise

    def read(self) -> dict[str, np.ndarray]:
        """Return the measured bends [rad, nominal]."""
        bends = self._strip_bends
        values = self._gains * bends * (1.0 + self._nonlinearities * bends)
        return {"flex": values + self._biases + self._noise}
