"""The MuJoCo model of an arm: rigid segments with an elastic joint in the middle of each.

Joints in the middle make the static shape converge with the square of the segment length; at the start it would be
linear (docs/simulator.md).
"""

import mujoco
import numpy as np
from scipy.linalg import eigh

from s2c2a.arm import ArmGeometry, ArmSpec, Module
from s2c2a.robots.simulation.fidelity import Fidelity
from s2c2a.spaces import CENTRE_LINE_POINTS

GRAVITY = 9.81  # m/s2
_ARMATURE = 1e-5  # kg m2 on every joint; keeps light, stiff segments from ringing
_AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
_MOST_TENSION = 1e6  # N
_TOLERANCE = 1e-6  # of implicit springs; moves a babbling arm by 0.1 um in 20 s, and saves a tenth of the time


def build_model(arm: ArmSpec, fidelity: Fidelity, payload: float = 0.0) -> mujoco.MjModel:
    """Compile the model of an arm.

    Sites `base_k` and `end_k` carry the frames of module k, sites `centre_...` are points of the centre line; actuator
    `cable_k_i` pulls cable i of module k.

    Args:
        arm: the description.
        fidelity: how finely to cut.
        payload: mass at the tip [kg].
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    _set_options(spec, arm)
    _add_chain(spec, arm, fidelity, payload)
    _add_cables(spec, arm, fidelity)
    model = spec.compile()
    _choose_steps(model, arm, fidelity)
    return model


def time_step(arm: ArmSpec, longest: float) -> float:
    """The physics step [s]: at most the longest, and a whole part of the control period."""
    return arm.control_period / np.ceil(arm.control_period / longest - 1e-9)


def _choose_steps(model: mujoco.MjModel, arm: ArmSpec, fidelity: Fidelity) -> None:
    """Explicit springs where the fidelity has them and they are soft enough for them, implicit ones elsewhere."""
    model.opt.timestep, model.opt.integrator = time_step(arm, fidelity.time_step), mujoco.mjtIntegrator.mjINT_DISCRETE
    if fidelity.explicit_time_step is None:
        return
    step = time_step(arm, fidelity.explicit_time_step)
    if _springs_allow(model, step):
        model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def _springs_allow(model: mujoco.MjModel, step: float) -> bool:
    """Whether explicit springs k and implicit damping d on masses m are stable with half to spare, straight and taut.

    The step's roots lie within the unit circle while h^2 k < 4 m + 2 h d; for matrices, while h^2 times the largest
    eigenvalue of the pair does.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    masses, levers = np.zeros((model.nv, model.nv)), np.zeros((model.nu, model.nv))
    for column, unit in zip(masses, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    rows = (data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    mujoco.mju_sparse2dense(levers, data.actuator_moment, *rows)
    pulls = -model.actuator_biasprm[:, 1]
    springs = np.diag(model.jnt_stiffness) + levers.T @ (pulls[:, None] * levers)
    largest = eigh(springs, 4.0 * masses + 2.0 * step * np.diag(model.dof_damping), eigvals_only=True)[-1]
    return bool(step**2 * largest < 0.5)


def _set_options(spec: mujoco.MjSpec, arm: ArmSpec) -> None:
    option = spec.option
    option.gravity = np.multiply(GRAVITY, arm.gravity_direction)
    option.tolerance = _TOLERANCE
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def joint_name(module: int, segment: int, axis: str) -> str:
    """Name of one hinge."""
    return f"joint_{module}_{segment}_{axis}"


def _add_chain(spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity, payload: float) -> None:
    """Bodies reach from one joint to the next: half a segment of their own, half of the following one."""
    body, reached = spec.worldbody, 0.0  # distance from the body's origin to the end of what is built
    for number, module in enumerate(arm.modules):
        half = module.length / fidelity.segments / 2
        _add_site(body, f"base_{number}", (0, 0, reached))
        _add_cable_sites(body, arm, number, 0, reached)
        for segment in range(fidelity.segments):
            following = _half_after(arm, fidelity, number, segment)
            body = body.add_body(name=f"body_{number}_{segment}", pos=(0, 0, reached + half))
            _add_joints(body, module, number, segment, fidelity)
            _set_inertia(body, module, half, following, payload if following is None else 0.0)
            _add_cable_sites(body, arm, number, segment + 1, half)
            if (segment + 1) % (fidelity.segments // CENTRE_LINE_POINTS) == 0:
                _add_site(body, f"centre_{number}_{segment}", (0, 0, half))
            reached = half
        _add_site(body, f"end_{number}", (0, 0, half))


def _half_after(arm: ArmSpec, fidelity: Fidelity, number: int, segment: int) -> tuple[Module, float] | None:
    """The module and length of the half segment that follows, or None at the tip."""
    if segment == fidelity.segments - 1:
        number += 1
    if number == arm.module_count:
        return None
    return arm.modules[number], arm.modules[number].length / fidelity.segments / 2


def _add_site(body, name: str, position) -> None:
    body.add_site(name=name, pos=position)


def _add_joints(body, module: Module, number: int, segment: int, fidelity: Fidelity) -> None:
    segment_length = module.length / fidelity.segments
    stiffnesses = {"x": module.bending_stiffness, "y": module.bending_stiffness}
    if fidelity.torsion:
        stiffnesses["z"] = module.gj
    for axis, stiffness in stiffnesses.items():
        body.add_joint(
            name=joint_name(number, segment, axis),
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=_AXES[axis],
            stiffness=stiffness / segment_length,
            damping=stiffness / segment_length * module.damping_time,
            armature=_ARMATURE,
        )


def _set_inertia(body, module: Module, half: float, following: tuple[Module, float] | None, payload: float) -> None:
    """Mass, centre and inertia of two half segments (thin solid cylinders) and a point mass at the tip."""
    pieces = [(module.mass * half / module.length, 0.0, half, module.cable_radius)]
    if following is not None:
        after, length = following
        pieces.append((after.mass * length / after.length, half, length, after.cable_radius))
    pieces.append((payload, half, 0.0, 0.0))
    masses = np.array([piece[0] for piece in pieces])
    centres = np.array([start + length / 2 for _, start, length, _ in pieces])
    centre = masses @ centres / masses.sum()
    across, along = 0.0, 0.0
    for (mass, _, length, radius), own in zip(pieces, centres, strict=True):
        across += mass * (length**2 / 12 + radius**2 / 4 + (own - centre) ** 2)
        along += mass * radius**2 / 2
    body.mass, body.ipos, body.inertia = masses.sum(), (0, 0, centre), (across, across, along)
    body.explicitinertial = True


def _cable_radius_points(module: Module) -> np.ndarray:
    angles = np.deg2rad(module.cable_angles_deg)
    return module.cable_radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)


def _add_cable_sites(body, arm: ArmSpec, number: int, station: int, height: float) -> None:
    """Points that the cables of this module, and where coupled of those above, pass at one station of a module."""
    owners = range(number, arm.module_count) if arm.coupled_cables else (number,)
    for owner in owners:
        for cable, point in enumerate(_cable_radius_points(arm.modules[owner])):
            _add_site(body, f"eye_{owner}_{cable}_{number}_{station}", point + np.array([0, 0, height]))


def _modules_passed(arm: ArmSpec, owner: int) -> range:
    return range(0 if arm.coupled_cables else owner, owner + 1)


def _add_cables(spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity) -> None:
    geometry = ArmGeometry.of(arm)
    for owner, module in enumerate(arm.modules):
        for cable in range(arm.cable_count):
            tendon = spec.add_tendon(name=f"cable_{owner}_{cable}")
            passed = _modules_passed(arm, owner)
            if fidelity.routed_cables:
                _route(tendon, owner, cable, passed, fidelity.segments)
                rest_length = sum(arm.modules[number].length for number in passed)
            else:
                _lever(tendon, geometry.cable_matrices[owner, cable] * module.cable_radius, passed, fidelity.segments)
                rest_length = 0.0
            stiffness = module.cable.stiffness if arm.actuation == "displacement" else None
            _add_pull(spec, tendon.name, stiffness, rest_length, geometry.pretensions[owner, cable])


def _route(tendon, owner: int, cable: int, passed: range, segments: int) -> None:
    for number in passed:
        for station in range(segments + 1):
            tendon.wrap_site(f"eye_{owner}_{cable}_{number}_{station}")


def _lever(tendon, lever: np.ndarray, passed: range, segments: int) -> None:
    """Length change r B b, with bend b_x about the y hinge and b_y about the x hinge turned the other way."""
    for number in passed:
        for segment in range(segments):
            tendon.wrap_joint(joint_name(number, segment, "y"), float(lever[0]))
            tendon.wrap_joint(joint_name(number, segment, "x"), float(-lever[1]))


def _add_pull(spec: mujoco.MjSpec, name: str, stiffness: float | None, rest_length: float, pretension: float) -> None:
    """An actuator that only pulls: a spring behind a commanded displacement, or a commanded tension (no stiffness)."""
    pull = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    pull.forcelimited, pull.forcerange = True, (-_MOST_TENSION, 0.0)
    pull.gaintype, pull.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    if stiffness is None:
        pull.gainprm[0] = -1.0
    else:
        pull.gainprm[0] = stiffness
        pull.biasprm[:3] = (stiffness * rest_length - pretension, -stiffness, 0.0)
