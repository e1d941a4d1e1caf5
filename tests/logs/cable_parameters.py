"""Cable models in tests."""

import numpy as np

from s2c2a.logs.cable_model import CableParameters, Wiring


def straight_arm(lengths, angles_deg=(0.0, 120.0, 240.0), **others) -> CableParameters:
    """Parameters of an arm with three drives a module, which is straight at zero.

    Args:
        lengths: of the modules [m].
        angles_deg: of the drives of a module, equal in all or by module.
        others: parameters that differ.
    """
    angles = np.deg2rad(np.broadcast_to(angles_deg, (len(lengths), 3))).ravel()
    return CableParameters(
        angles=angles,
        gain=np.array(0.0),
        gains=np.zeros(len(angles)),
        offsets=np.zeros(len(angles)),
        lengths=np.log(lengths),
        stiffness=np.log(0.2),
        gravity=np.array(0.0),
        tilt=np.zeros(2),
        base=np.zeros(3),
    )._replace(**others)


def wiring_of(modules, sign=1.0) -> Wiring:
    """Three drives a module, each with one cable from its own module on."""
    drives = 3 * modules
    reach = np.repeat(np.eye(modules), 3, axis=0)
    return Wiring(reach, np.arange(drives), np.zeros(drives), np.full(drives, sign))
