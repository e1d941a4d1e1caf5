"""The MuJoCo model of an arm: rigid segments with an elastic joint in the middle of each.

Joints in the middle make the static shape converge with the square of the segment length; at the start it would be
linear (docs/simulator.md).
"""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from scipy.linalg import eigh

from s2c2a.arm import ArmGeometry, ArmSpec, Module
from s2c2a.errors import S2C2AError
from s2c2a.spaces import CENTRE_LINE_POINTS

GRAVITY = 9.81  # m/s2
_ARMATURE = 1e-5  # kg m2 on every joint; keeps light, stiff segments from ringing
_MOST_TENSION = 1e6  # N
_TOLERANCE = 1e-6  # of implicit springs; moves a babbling arm by 0.1 um in 20 s, and saves a tenth of the time


@dataclass(frozen=True)
class Fidelity:
    """A layout of the chain.

    Attributes:
        name: the word a user types.
        segments: rigid segments a module, a multiple of five: five points of each centre line are watched.
        torsion: whether modules can twist about their own axis.
        routed_cables: cables led through points in space (true), or acting on the joints alone (false: faster).
        time_step: largest physics step [s]; shortened so that it divides the control period.
        explicit_time_step: the same with springs as they are at the step's start instead of at its end: nearer to the
            true motion and quicker, but only stable with springs that are soft enough for it; none: never.
    """

    name: str
    segments: int
    torsion: bool
    routed_cables: bool
    time_step: float
    explicit_time_step: float | None = None


FIDELITIES = {
    "fast": Fidelity("fast", segments=5, torsion=False, routed_cables=False, time_step=0.005),
    "accurate": Fidelity(
        "accurate", segments=10, torsion=True, routed_cables=True, time_step=0.002, explicit_time_step=0.003
    ),
}


def fidelity_named(name: str) -> Fidelity:
    """Look a fidelity up.

    Raises:
        S2C2AError: no such fidelity.
    """
    if name not in FIDELITIES:
        raise S2C2AError(f"no fidelity '{name}'; choose one of {', '.join(FIDELITIES)}")
    return FIDELITIES[name]


def build_model(arm: ArmSpec, fidelity: Fidelity, payload: float = 0.0, watched: bool = False) -> mujoco.MjModel:
    """Compile the model of an arm.

    Sites `base_k` and `end_k` carry the frames of module k; actuator `cable_k_i` pulls cable i of module k.

    Args:
        arm: the description.
        fidelity: how finely to cut.
        payload: mass at the tip [kg].
        watched: whether sensors say where the points of the centre line are.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    _set_options(spec, arm)
    _add_chain(spec, arm, fidelity, payload, watched)
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


def _add_chain(spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity, payload: float, watched: bool) -> None:
    """Bodies reach from one joint to the next: half a segment of their own, half of the following one."""
    body, reached = spec.worldbody, 0.0  # distance from the body's origin to the end of what is built
    halves = [(module, module.length / fidelity.segments / 2) for module in arm.modules]
    following = iter([half for half in halves for _ in range(fidelity.segments)][1:])
    for number, (module, half) in enumerate(halves):
        body.add_site(name=f"base_{number}", pos=(0, 0, reached))
        _add_cable_sites(body, arm, number, 0, reached)
        for segment in range(fidelity.segments):
            body = body.add_body(name=f"body_{number}_{segment}", pos=(0, 0, reached + half))
            _add_joints(body, module, number, segment, fidelity)
            _set_inertia(body, (module, half), next(following, None), payload)
            _add_cable_sites(body, arm, number, segment + 1, half)
            if watched and (segment + 1) % (fidelity.segments // CENTRE_LINE_POINTS) == 0:
                _add_watched_point(spec, body, f"centre_{number}_{segment}", half)
            reached = half
        body.add_site(name=f"end_{number}", pos=(0, 0, half))


def _add_watched_point(spec: mujoco.MjSpec, body, name: str, height: float) -> None:
    body.add_site(name=name, pos=(0, 0, height))
    place, site = mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtObj.mjOBJ_SITE
    spec.add_sensor(name=name, type=place, objtype=site, objname=name)


def _add_joints(body, module: Module, number: int, segment: int, fidelity: Fidelity) -> None:
    segment_length = module.length / fidelity.segments
    stiffnesses = {"x": module.bending_stiffness, "y": module.bending_stiffness}
    if fidelity.torsion:
        stiffnesses["z"] = module.gj
    hinges = list(zip(stiffnesses.items(), np.eye(3), strict=False))
    if fidelity.torsion and (number * fidelity.segments + segment) % 2:
        hinges.reverse()  # turns do not commute; in one order all along, bends would add up to a twist of first order
    for (axis, stiffness), direction in hinges:
        body.add_joint(
            name=joint_name(number, segment, axis),
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=direction,
            stiffness=stiffness / segment_length,
            damping=stiffness / segment_length * module.damping_time,
            armature=_ARMATURE,
        )


def _set_inertia(body, own: tuple[Module, float], following: tuple[Module, float] | None, payload: float) -> None:
    """Mass, centre and inertia of two half segments (thin solid cylinders), at the tip of one and a point mass."""
    half = own[1]
    pieces = [
        (module.mass * length / module.length, start, length, module.cable_radius)
        for (module, length), start in ((own, 0.0), *([(following, half)] if following else ()))
    ]
    if following is None:
        pieces.append((payload, half, 0.0, 0.0))
    masses, starts, lengths, radii = np.array(pieces).T
    centres = starts + lengths / 2
    centre = masses @ centres / masses.sum()
    across = np.sum(masses * (lengths**2 / 12 + radii**2 / 4 + (centres - centre) ** 2))
    body.mass, body.ipos, body.inertia = masses.sum(), (0, 0, centre), (across, across, np.sum(masses * radii**2 / 2))
    body.explicitinertial = True


def _add_cable_sites(body, arm: ArmSpec, number: int, station: int, height: float) -> None:
    """Points that the cables of this module, and where coupled of those above, pass at one station of a module."""
    for owner in range(number, arm.module_count if arm.coupled_cables else number + 1):
        module = arm.modules[owner]
        for cable, angle in enumerate(np.deg2rad(module.cable_angles_deg)):
            point = (module.cable_radius * np.cos(angle), module.cable_radius * np.sin(angle), height)
            body.add_site(name=f"eye_{owner}_{cable}_{number}_{station}", pos=point)


def _add_cables(spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity) -> None:
    geometry = ArmGeometry.of(arm)
    for owner, cable in np.ndindex(geometry.pretensions.shape):
        module, tendon = arm.modules[owner], spec.add_tendon(name=f"cable_{owner}_{cable}")
        passed, rest_length = range(0 if arm.coupled_cables else owner, owner + 1), 0.0
        if fidelity.routed_cables:
            for number, station in product(passed, range(fidelity.segments + 1)):
                tendon.wrap_site(f"eye_{owner}_{cable}_{number}_{station}")
            rest_length = sum(arm.modules[number].length for number in passed)
        else:
            _lever(tendon, geometry.cable_matrices[owner, cable] * module.cable_radius, passed, fidelity.segments)
        stiffness = module.cable.stiffness if arm.actuation == "displacement" else None
        _add_pull(spec, tendon.name, stiffness, rest_length, float(geometry.pretensions[owner, cable]))


def _lever(tendon, lever: np.ndarray, passed: range, segments: int) -> None:
    """Length change r B b, with bend b_x about the y hinge and b_y about the x hinge turned the other way."""
    for number, segment in product(passed, range(segments)):
        tendon.wrap_joint(joint_name(number, segment, "y"), float(lever[0]))
        tendon.wrap_joint(joint_name(number, segment, "x"), float(-lever[1]))


def _add_pull(spec: mujoco.MjSpec, name: str, stiffness: float | None, rest_length: float, pretension: float) -> None:
    """An actuator that only pulls: a spring behind a commanded displacement, or a commanded tension (no stiffness)."""
    pull = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    pull.forcelimited, pull.forcerange = True, (-_MOST_TENSION, 0.0)
    pull.gaintype, pull.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    pull.gainprm[0] = -1.0 if stiffness is None else stiffness
    if stiffness is not None:
        pull.biasprm[:3] = (stiffness * rest_length - pretension, -stiffness, 0.0)
