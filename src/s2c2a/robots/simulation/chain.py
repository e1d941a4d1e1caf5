"""MuJoCo model of an arm: rigid segments with an elastic joint in the middle of each.

With joints in the middle, the static shape converges with the square of the segment
length; with joints at the start it would converge linearly (docs/concepts/simulator.md).
"""

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import mujoco
import numpy as np
import scipy

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import cables_present
from s2c2a.errors import S2C2AError, no_such
from s2c2a.robots.simulation.mismatched_module import MismatchedModule, cable_routing
from s2c2a.spaces import CENTER_LINE_POINTS

_ARMATURE = 1e-5  # kg m2 on every joint; light, stiff segments would oscillate without
# Tolerance of the solver of implicit springs. It moves a babbling arm by 0.1 um in 20 s
# and saves a tenth of the time.
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Fidelity:
    """Discretization of the chain.

    Attributes:
        segments: rigid segments a module, a multiple of `CENTER_LINE_POINTS`, at which
            the center line is recorded.
        torsion: whether modules can twist about their own axis.
        routed_cables: whether cables pass through points in space (more accurate) or
            act on the joints with constant lever arms (faster).
        time_step: largest physics step [s]; shortened to a divisor of the control
            period.
        explicit_time_step: largest physics step [s] with explicit springs, which is
            more accurate and faster but stable for soft springs only; None: never.
    """

    segments: int
    torsion: bool
    routed_cables: bool
    time_step: float
    explicit_time_step: float | None = None


FIDELITIES = {
    "fast": Fidelity(segments=5, torsion=False, routed_cables=False, time_step=0.005),
    "accurate": Fidelity(
        segments=10,
        torsion=True,
        routed_cables=True,
        time_step=0.002,
        explicit_time_step=0.003,
    ),
}
"""Fidelities of the simulation, by name."""


def get_fidelity(name: str) -> Fidelity:
    """Return a fidelity by name.

    Raises:
        S2C2AError: there is no such fidelity.
    """
    if name not in FIDELITIES:
        raise S2C2AError(no_such("fidelity", name, FIDELITIES))
    return FIDELITIES[name]


def build_model(
    arm: ArmSpec, fidelity: Fidelity, payload: float = 0.0, center_line: bool = False
) -> mujoco.MjModel:
    """Compile the model of an arm.

    Sites `base_k` and `end_k` carry the frames of module k; actuator `cable_k_i` pulls
    cable i of module k.

    Args:
        arm: the description, with its mismatch.
        fidelity: the discretization.
        payload: mass at the tip, beside that of the arm file [kg].
        center_line: whether sensors measure the points of the center line.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.gravity = arm.gravity
    option.tolerance = _TOLERANCE
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    _add_chain(spec, arm, fidelity, arm.tip.mass + payload, center_line)
    _add_cables(spec, arm, fidelity)
    if arm.sensors.imu is not None:
        # add accelerometers of all modules, then gyroscopes of all, at their ends
        kinds = (mujoco.mjtSensor.mjSENS_ACCELEROMETER, mujoco.mjtSensor.mjSENS_GYRO)
        for number, kind in enumerate(kinds):
            for module in range(arm.module_count):
                spec.add_sensor(
                    name=f"inertial_{number}_{module}",
                    type=kind,
                    objtype=mujoco.mjtObj.mjOBJ_SITE,
                    objname=f"end_{module}",
                )
    model = spec.compile()
    _set_time_step(model, arm, fidelity)
    return model


def time_step(arm: ArmSpec, longest: float) -> float:
    """Return the longest physics step [s] that divides the control period."""
    return arm.control_period / np.ceil(arm.control_period / longest - 1e-9)


def _set_time_step(model: mujoco.MjModel, arm: ArmSpec, fidelity: Fidelity) -> None:
    """Choose explicit springs if they are stable, and implicit springs otherwise."""
    model.opt.timestep = time_step(arm, fidelity.time_step)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    if fidelity.explicit_time_step is None:
        return
    step = time_step(arm, fidelity.explicit_time_step)
    hardening = max(module.mismatch.hardening for module in arm.modules)
    # The cubic spring of a joint is three times as stiff locally at full bend.
    hardening_factor = 1.0 + 3.0 * hardening
    # Explicit springs of the straight arm with taut cables: with stiffness k, implicit
    # damping d and mass m, a step h is stable while h^2 k < 4 m + 2 h d; for matrices,
    # while h^2 times the largest generalized eigenvalue is below one. Half of that is
    # the limit here.
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    masses = np.zeros((model.nv, model.nv))
    for column, unit in zip(masses, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    levers = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        levers,
        data.actuator_moment,
        data.moment_rownnz,
        data.moment_rowadr,
        data.moment_colind,
    )
    cable_stiffnesses = -model.actuator_biasprm[:, 1]
    stiffness = hardening_factor * np.diag(model.jnt_stiffness)
    stiffness = stiffness + levers.T @ (cable_stiffnesses[:, None] * levers)
    limit = 4.0 * masses + 2.0 * step * np.diag(model.dof_damping)
    largest = scipy.linalg.eigh(stiffness, limit, eigvals_only=True)[-1]
    if step**2 * largest < 0.5:
        model.opt.timestep = step
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def joint_name(module: int, segment: int, axis: str) -> str:
    """Return the name of one hinge."""
    return f"joint_{module}_{segment}_{axis}"


def slide_name(module: int) -> str:
    """Return the name of the joint that shortens a module."""
    return f"slide_{module}"


def module_of_joint(name: str) -> int:
    """Return the module of a joint by the joint's name."""
    return int(name.split("_")[1])


class _HalfSegment(NamedTuple):
    """Half a segment of a module, and its length [m]."""

    module: MismatchedModule
    length: float


def _add_chain(
    spec: mujoco.MjSpec,
    arm: ArmSpec,
    fidelity: Fidelity,
    tip_mass: float,
    center_line: bool,
) -> None:
    """Add the bodies; each reaches from one joint to the next.

    A body is half a segment of its own and half of the following segment.
    """
    modules = [MismatchedModule.of(module) for module in arm.modules]
    halves = []
    for module in modules:
        half_length = module.nominal.length / fidelity.segments / 2
        halves.append(_HalfSegment(module, half_length))
    last_segment = fidelity.segments - 1
    segments_per_point = fidelity.segments // CENTER_LINE_POINTS
    body = spec.worldbody
    end = 0.0  # m; from the body's origin to the end of the chain so far
    for number, half in enumerate(halves):
        body.add_site(name=f"base_{number}", pos=(0, 0, end))
        _add_cable_sites(body, arm, modules, (number, 0), end)
        for segment in range(fidelity.segments):
            body = body.add_body(
                name=f"body_{number}_{segment}", pos=(0, 0, end + half.length)
            )
            # axial compliance: one slide joint, which moves the end within 0.2 mm of one
            # for each segment
            nominal = half.module.nominal
            is_middle = segment == fidelity.segments // 2
            if is_middle and nominal.mismatch.axial_stiffness is not None:
                stiffness = nominal.mismatch.axial_stiffness / nominal.length
                body.add_joint(
                    name=slide_name(number),
                    type=mujoco.mjtJoint.mjJNT_SLIDE,
                    axis=(0, 0, 1),
                    stiffness=stiffness,
                    damping=stiffness * nominal.damping_time,
                )
            _add_joints(body, half.module, number, segment, fidelity)
            following: _HalfSegment | None = half
            if segment == last_segment:
                following = halves[number + 1] if number + 1 < len(halves) else None
            _set_inertia(body, half, following, tip_mass)
            _add_cable_sites(body, arm, modules, (number, segment + 1), half.length)
            if center_line and (segment + 1) % segments_per_point == 0:
                name = f"center_{number}_{segment}"
                body.add_site(name=name, pos=(0, 0, half.length))
                spec.add_sensor(
                    name=name,
                    type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
                    objtype=mujoco.mjtObj.mjOBJ_SITE,
                    objname=name,
                )
            end = half.length
        body.add_site(name=f"end_{number}", pos=(0, 0, half.length))


def _add_joints(
    body, module: MismatchedModule, number: int, segment: int, fidelity: Fidelity
) -> None:
    length = module.nominal.length / fidelity.segments
    rest_angles = module.rest_angles / fidelity.segments
    cubic = module.cubic_stiffnesses(fidelity.segments)
    hinges = list(enumerate("xyz" if fidelity.torsion else "xy"))
    if fidelity.torsion and (number * fidelity.segments + segment) % 2:
        # Rotations do not commute: with one order in all segments, bends would add up
        # to a first-order twist.
        hinges.reverse()
    for row, axis in hinges:
        stiffness = module.stiffnesses[row] / length
        body.add_joint(
            name=joint_name(number, segment, axis),
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=module.axes[row],
            # coefficients of the angle, its square, its cube
            stiffness=(stiffness, 0.0, cubic[row]),
            springref=rest_angles[row],
            damping=stiffness * module.nominal.damping_time,
            armature=_ARMATURE,
        )


def _set_inertia(
    body, own: _HalfSegment, following: _HalfSegment | None, tip_mass: float
) -> None:
    """Set mass, center of mass and inertia of two half segments.

    Half segments are thin solid cylinders. The last body has one of them and what is
    at the tip, a point mass.
    """
    pieces = [_cylinder(own, 0.0)]
    if following is None:
        pieces.append((tip_mass, own.length, 0.0, 0.0))
    else:
        pieces.append(_cylinder(following, own.length))
    masses, starts, lengths, radii = np.array(pieces).T
    centers = starts + lengths / 2
    center = masses @ centers / masses.sum()
    offsets = centers - center
    lateral = np.sum(masses * (lengths**2 / 12 + radii**2 / 4 + offsets**2))
    body.mass = masses.sum()
    body.ipos = (0, 0, center)
    body.inertia = (lateral, lateral, np.sum(masses * radii**2 / 2))
    body.explicitinertial = True


def _cylinder(half: _HalfSegment, start: float) -> tuple[float, float, float, float]:
    """Return mass [kg], start, length and radius [m] of a half segment."""
    nominal = half.module.nominal
    mass = half.module.mass * half.length / nominal.length
    return mass, start, half.length, nominal.cable_radius


def _add_cable_sites(
    body,
    arm: ArmSpec,
    modules: list[MismatchedModule],
    station: tuple[int, int],
    height: float,
) -> None:
    """Add the points of all cables that pass a station (module, segment boundary)."""
    for owner, module in enumerate(modules):
        share = cable_routing(arm, owner).get(station[0])
        if share is None:
            continue
        for cable, (x, y) in enumerate(module.cables):
            body.add_site(
                name=_cable_site_name(owner, cable, station),
                pos=(share * x, share * y, height),
            )


def _cable_site_name(owner: int, cable: int, station: tuple[int, int]) -> str:
    return f"eye_{owner}_{cable}_{station[0]}_{station[1]}"


def _add_cables(spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity) -> None:
    geometry = ArmGeometry.of(arm)
    modules = [MismatchedModule.of(module) for module in arm.modules]
    for owner, cable in np.argwhere(cables_present(arm)).tolist():
        tendon = spec.add_tendon(name=f"cable_{owner}_{cable}")
        rest_length = 0.0
        if fidelity.routed_cables:
            routing = cable_routing(arm, owner)
            for station in product(routing, range(fidelity.segments + 1)):
                tendon.wrap_site(_cable_site_name(owner, cable, station))
            # along the straight arm; it steps outward where it enters its own module
            radius = np.linalg.norm(modules[owner].cables[cable])
            steps = np.abs(np.diff(list(routing.values()))) * radius
            along = sum(arm.modules[number].length for number in routing)
            rest_length = along + float(steps.sum())
        else:
            # a constant lever arm about every hinge and slide that it passes
            for number, share in cable_routing(arm, owner).items():
                levers = share * modules[owner].cable_levers(modules[number].axes)
                about_x, about_y = map(float, levers[cable, :2])
                for segment in range(fidelity.segments):
                    tendon.wrap_joint(joint_name(number, segment, "y"), about_y)
                    tendon.wrap_joint(joint_name(number, segment, "x"), about_x)
                if arm.modules[number].mismatch.axial_stiffness is not None:
                    tendon.wrap_joint(slide_name(number), 1.0)
        parameters = arm.modules[owner].cable
        # add an actuator that pulls with the commanded tension less viscous friction
        actuator = spec.add_actuator(
            name=tendon.name, target=tendon.name, trntype=mujoco.mjtTrn.mjTRN_TENDON
        )
        actuator.forcelimited = True
        actuator.forcerange = (-mujoco.mjMAXVAL, 0.0)  # cables never push
        actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0] = -1.0
        actuator.biasprm[2] = -parameters.viscous_friction
        if arm.actuation == "pressure":
            # turn an actuator into a chamber, which takes a pressure and pushes
            area = arm.modules[owner].chamber_area or 0.0
            actuator.forcerange = (0.0, mujoco.mjMAXVAL)
            actuator.gainprm[0] = area
        if arm.actuation == "displacement":
            pretension = float(geometry.pretensions[owner, cable])
            # put a spring behind an actuator, which then takes a commanded displacement
            stiffness = parameters.stiffness
            actuator.gainprm[0] = stiffness
            actuator.biasprm[0] = stiffness * rest_length - pretension
            actuator.biasprm[1] = -stiffness
