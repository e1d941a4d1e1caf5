"""Flex sensors of the simulated arm: resistive strips along its modules, cheap ones."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.sensors import Flex
from s2c2a.kinematics import configurations_from_states
from s2c2a.spaces import States

# streams of random numbers
_STRIPS = 5
_NOISE = 6
MINUTE = 60.0  # s


class FlexStrips:
    """What strips along the modules say of how far they bend.

    A strip at angle a of a module with bend b is bent by u = b_x cos a + b_y sin a, and
    takes in a little of other modules' bends. It says g v (1 + c v) + z, with a gain g
    and a curve c of its own, a zero z that wanders, and v, which follows u with backlash,
    for strips creep in what they are glued to.
    """

    def __init__(self, arm: ArmSpec, part: Flex, seed: int, opening: int):
        """The same strips at every opening; their zeros differ."""
        shape = arm.module_count, len(part.angles_deg)
        own = np.random.default_rng([part.strips, _STRIPS])
        angles = np.deg2rad(part.angles_deg) + own.normal(
            scale=np.deg2rad(part.angle_error_deg), size=shape
        )
        self._gains = 1.0 + own.normal(scale=part.gain_error, size=shape)
        self._curves = own.normal(scale=part.nonlinearity, size=shape)
        others = (
            own.normal(scale=part.crosstalk, size=(*shape, arm.module_count))
            * ~np.eye(shape[0], dtype=bool)[:, None]
        )
        shares = others + np.eye(shape[0])[:, None]  # (modules, strips, modules)
        self._levers = (
            shares[..., None]
            * np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, :, None]
        )
        self._part = part
        self._random = np.random.default_rng([seed, _NOISE, opening])
        self._zeros = self._random.normal(scale=part.zero_error, size=shape)
        self._followed = np.zeros(shape)
        self._noise = np.zeros(shape)

    def bend(self, states: States, seconds: float) -> None:
        """They are bent as the modules are now, so many seconds after the last time."""
        part = self._part
        bent = np.einsum("mskc,kc->ms", self._levers, _bends(states))
        self._followed = np.clip(
            self._followed, bent - part.hysteresis, bent + part.hysteresis
        )
        drawn = self._random.normal(size=(2, *bent.shape))
        self._zeros = self._zeros + part.drift * np.sqrt(seconds / MINUTE) * drawn[0]
        self._noise = part.noise * drawn[1]

    def read(self) -> dict[str, np.ndarray]:
        """In a reading [rad, nominal]."""
        said = self._gains * self._followed * (1.0 + self._curves * self._followed)
        return {"flex": said + self._zeros + self._noise}


def _bends(states: States) -> Float[np.ndarray, "modules 2"]:
    configurations = configurations_from_states(states)
    across = np.linalg.norm(configurations[:, :2], axis=-1, keepdims=True)
    angles = np.arctan2(across, configurations[:, 2:])
    return configurations[:, :2] * angles / np.maximum(across, np.finfo(float).tiny)
