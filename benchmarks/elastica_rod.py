"""The rod cases in PyElastica, set up as well as we know how.

Needs PyElastica; the extra `bench` brings it.
"""

import elastica
import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import Module

from rod_cases import RodCase

# m; with it and EI the rod stretches by half a percent at most under its weight
RADIUS = 0.02
# 1/s, critical for the first mode without gravity: it comes to rest soonest
DAMPING = 7.0
GRAVITY = 9.81  # m/s^2


class _Simulator(
    elastica.BaseSystemCollection,
    elastica.Constraints,
    elastica.Forcing,
    elastica.Damping,
):
    """What a case needs of PyElastica."""


class ElasticaRod:
    """A rod case as a Cosserat rod of equal elements.

    Cables act inside their module alone and pull along it, so within it they are a
    constant moment in the frame of the cross-section: a rest curvature, and at joints
    between two modules the mean of both. Wound round the center line they also resist
    twist. Joints carry the curvature of half an element on either side; the clamp would
    hide the half element at the base, so the rod begins one element below it, and the
    joint at the base bends half as much.

    Args:
        case: an arm under load.
        elements: of the arm, a multiple of its modules.
        time_step: [s].
        stiffer: how many times stiffer than its material it is against stretch and
            shear, to come near to a rod that does neither; the stiffer, the shorter the
            stable time step.
    """

    def __init__(self, case: RodCase, elements: int, time_step: float, stiffer: float):
        self._time_step = time_step
        self._now = 0.0
        self._stepper = elastica.PositionVerlet()
        self._rod = _rod(case, elements, stiffer)
        self._simulator = _Simulator()
        self._simulator.append(self._rod)
        self._clamp_and_load(case)
        self._simulator.finalize()

    def advance(self, seconds: float) -> None:
        """Simulate for so long [s]."""
        for _ in range(round(seconds / self._time_step)):
            self._now = self._stepper.step(self._simulator, self._now, self._time_step)

    @property
    def tip(self) -> Float[np.ndarray, "3"]:
        """Where the tip is [m], base frame."""
        return self._rod.position_collection[:, -1].copy()

    def _clamp_and_load(self, case: RodCase) -> None:
        self._simulator.constrain(self._rod).using(
            elastica.OneEndFixedBC,
            constrained_position_idx=(0,),
            constrained_director_idx=(0,),
        )
        gravity = GRAVITY * np.array(case.arm.gravity_direction)
        self._simulator.add_forcing_to(self._rod).using(
            elastica.GravityForces, acc_gravity=gravity
        )
        self._simulator.add_forcing_to(self._rod).using(
            elastica.EndpointForces,
            np.zeros(3),
            case.tip_force.astype(float),
            ramp_up_time=1e-6,
        )
        self._simulator.dampen(self._rod).using(
            elastica.AnalyticalLinearDamper,
            uniform_damping_constant=DAMPING,
            time_step=self._time_step,
        )


def _rod(case: RodCase, elements: int, stiffer: float):
    """A straight rod along z with one element below the base and equal modules."""
    module = case.arm.modules[0]
    size = case.arm.length / elements
    stiffness = module.bending_stiffness
    modulus = stiffness / (np.pi * RADIUS**4 / 4)
    rod = elastica.CosseratRod.straight_rod(
        n_elements=elements + 1,
        start=np.array([0.0, 0.0, -size]),
        direction=np.array([0.0, 0.0, 1.0]),
        normal=np.array([1.0, 0.0, 0.0]),
        base_length=case.arm.length + size,
        base_radius=RADIUS,
        density=module.mass / module.length / (np.pi * RADIUS**2),
        youngs_modulus=modulus,
        shear_modulus=modulus * module.gj / stiffness / 2,
    )
    rod.shear_matrix *= stiffer
    moments, winding = _at_joints(case, elements)
    rod.rest_kappa[:2] = moments.T / stiffness
    rod.bend_matrix[2, 2] += winding
    rod.bend_matrix[..., 0] *= 2.0  # half an element bends there, and so
    rod.rest_kappa[:, 0] /= 2.0  # is its rest curvature half of that of a whole one
    return rod


def _at_joints(
    case: RodCase, elements: int
) -> tuple[Float[np.ndarray, "joints 2"], Float[np.ndarray, " joints"]]:
    """Moments [N m] and additions to GJ [N m^2] of the cables, at base and joints."""
    share = elements // case.arm.module_count
    pairs = zip(case.arm.modules, case.tensions, strict=True)
    every = np.repeat(
        [_cables(module, tensions) for module, tensions in pairs], share, axis=0
    )
    joints = np.concatenate([every[:1], (every[1:] + every[:-1]) / 2])
    return joints[:, :2], joints[:, 2]


def _cables(
    module: Module, tensions: Float[np.ndarray, " cables"]
) -> Float[np.ndarray, "3"]:
    """Moment about both cross-section axes [N m], and torsional stiffness [N m^2]."""
    angles = np.deg2rad(module.cable_angles_deg)
    levers = module.cable_radius * np.stack([np.cos(angles), np.sin(angles)])
    x, y = levers @ tensions
    return np.array([-y, x, module.cable_radius**2 * tensions.sum()])
