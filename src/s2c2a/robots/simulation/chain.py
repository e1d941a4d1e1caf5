"""The MuJoCo model of an arm: rigid segments with an elastic joint in the middle of each.

Joints in the middle make the static shape converge with the square of the segment
length; at the start it would be linear (docs/simulator.md).
"""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from scipy.linalg import eigh

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.robots.simulation.mismatched_module import MismatchedModule, passed_shares
from s2c2a.spaces import CENTER_LINE_POINTS

_ARMATURE = 1e-5  # kg m2 on every joint; keeps light, stiff segments from ringing
_MAX_TENSION = 1e6  # N
# of implicit springs; moves a babbling arm by 0.1 um in 20 s, and saves a tenth of the
# time
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Fidelity:
    """A layout of the chain.

    Attributes:
        name: the word a user types.
        segments: rigid segments a module, a multiple of five: five points of each
            center line are watched.
        torsion: whether modules can twist about their own axis.
        routed_cables: cables led through points in space (true), or acting on the
            joints alone (false: faster).
        time_step: largest physics step [s]; shortened so that it divides the control
            period.
        explicit_time_step: the same with springs as they are at the step's start
            instead of at its end: nearer to the true motion and quicker, but only
            stable with springs that are soft enough for it; none: never.
    """

    name: str
    segments: int
    torsion: bool
    routed_cables: bool
    time_step: float
    explicit_time_step: float | None = None


FIDELITIES = {
    "fast": Fidelity(
        "fast", segments=5, torsion=False, routed_cables=False, time_step=0.005
    ),
    "accurate": Fidelity(
        "accurate",
        segments=10,
        torsion=True,
        routed_cables=True,
        time_step=0.002,
        explicit_time_step=0.003,
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


def build_model(
    arm: ArmSpec, fidelity: Fidelity, payload: float = 0.0, watched: bool = False
) -> mujoco.MjModel:
    """Compile the model of an arm.

    Sites `base_k` and `end_k` carry the frames of module k; actuator `cable_k_i` pulls
    cable i of module k.

    Args:
        arm: the description.
        fidelity: how finely to cut.
        payload: mass at the tip [kg].
        watched: whether sensors say where the points of the center line are.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    _set_options(spec, arm)
    _add_chain(spec, arm, fidelity, payload, watched)
    _add_cables(spec, arm, fidelity)
    if arm.sensors.imu is not None:
        _add_inertial_sensors(spec, arm.module_count)
    model = spec.compile()
    _choose_steps(model, arm, fidelity)
    return model


def time_step(arm: ArmSpec, longest: float) -> float:
    """The physics step [s]: at most the longest, and a whole part of the control period."""
    return arm.control_period / np.ceil(arm.control_period / longest - 1e-9)


def _choose_steps(model: mujoco.MjModel, arm: ArmSpec, fidelity: Fidelity) -> None:
    """Explicit springs where the fidelity has them and they are soft enough for them, implicit ones elsewhere."""
    model.opt.timestep, model.opt.integrator = (
        time_step(arm, fidelity.time_step),
        mujoco.mjtIntegrator.mjINT_DISCRETE,
    )
    if fidelity.explicit_time_step is None:
        return
    step = time_step(arm, fidelity.explicit_time_step)
    if _springs_allow(
        model,
        step,
        1.0 + 3.0 * max(module.mismatch.hardening for module in arm.modules),
    ):
        model.opt.timestep, model.opt.integrator = (
            step,
            mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
        )


def _springs_allow(model: mujoco.MjModel, step: float, hardest: float) -> bool:
    """Whether explicit springs k and implicit damping d on masses m are stable with half to spare, straight and taut.

    The step's roots lie within the unit circle while h^2 k < 4 m + 2 h d; for matrices,
    while h^2 times the largest eigenvalue of the pair does. Joints count `hardest`
    times, as at full bend.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    masses = np.zeros((model.nv, model.nv))
    levers = np.zeros((model.nu, model.nv))
    for column, unit in zip(masses, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    rows = (data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    mujoco.mju_sparse2dense(levers, data.actuator_moment, *rows)
    pulls = -model.actuator_biasprm[:, 1]
    springs = hardest * np.diag(model.jnt_stiffness) + levers.T @ (
        pulls[:, None] * levers
    )
    largest = eigh(
        springs,
        4.0 * masses + 2.0 * step * np.diag(model.dof_damping),
        eigvals_only=True,
    )[-1]
    return bool(step**2 * largest < 0.5)


def _set_options(spec: mujoco.MjSpec, arm: ArmSpec) -> None:
    option = spec.option
    option.gravity = arm.gravity
    option.tolerance = _TOLERANCE
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
        mujoco.mjtDisableBit.mjDSBL_AUTORESET
    )


def joint_name(module: int, segment: int, axis: str) -> str:
    """Name of one hinge."""
    return f"joint_{module}_{segment}_{axis}"


def slide_name(module: int) -> str:
    """Name of the joint by which a module's center line shortens."""
    return f"slide_{module}"


def module_of_joint(name: str) -> int:
    """The module that a joint of that name belongs to."""
    return int(name.split("_")[1])


def _add_chain(
    spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity, payload: float, watched: bool
) -> None:
    """Bodies reach from one joint to the next: half a segment of their own, half of the following one."""
    # distance from the body's origin to the end of what is built
    body = spec.worldbody
    reached = 0.0
    modules = [MismatchedModule.of(module) for module in arm.modules]
    halves = [
        (module, module.described.length / fidelity.segments / 2) for module in modules
    ]
    following = iter([half for half in halves for _ in range(fidelity.segments)][1:])
    for number, (module, half) in enumerate(halves):
        body.add_site(name=f"base_{number}", pos=(0, 0, reached))
        _add_cable_sites(body, arm, modules, (number, 0), reached)
        for segment in range(fidelity.segments):
            body = body.add_body(
                name=f"body_{number}_{segment}", pos=(0, 0, reached + half)
            )
            if segment == fidelity.segments // 2:
                _add_slide(body, module, number)
            _add_joints(body, module, number, segment, fidelity)
            _set_inertia(body, (module, half), next(following, None), payload)
            _add_cable_sites(body, arm, modules, (number, segment + 1), half)
            if (
                watched
                and (segment + 1) % (fidelity.segments // CENTER_LINE_POINTS) == 0
            ):
                _add_watched_point(spec, body, f"center_{number}_{segment}", half)
            reached = half
        body.add_site(name=f"end_{number}", pos=(0, 0, half))


def _add_watched_point(spec: mujoco.MjSpec, body, name: str, height: float) -> None:
    body.add_site(name=name, pos=(0, 0, height))
    place = mujoco.mjtSensor.mjSENS_FRAMEPOS
    site = mujoco.mjtObj.mjOBJ_SITE
    spec.add_sensor(name=name, type=place, objtype=site, objname=name)


def _add_inertial_sensors(spec: mujoco.MjSpec, modules: int) -> None:
    """What they accelerate by at the ends of modules, then how they turn, all in the frames there."""
    site = mujoco.mjtObj.mjOBJ_SITE
    kinds = (mujoco.mjtSensor.mjSENS_ACCELEROMETER, mujoco.mjtSensor.mjSENS_GYRO)
    for (number, kind), module in product(enumerate(kinds), range(modules)):
        spec.add_sensor(
            name=f"inertial_{number}_{module}",
            type=kind,
            objtype=site,
            objname=f"end_{module}",
        )


def _add_slide(body, module: MismatchedModule, number: int) -> None:
    """One for a module that shortens: in its middle it moves the end within 0.2 mm of as many as there are segments."""
    described = module.described
    if described.mismatch.axial_stiffness is None:
        return
    stiffness = described.mismatch.axial_stiffness / described.length
    body.add_joint(
        name=slide_name(number),
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=(0, 0, 1),
        stiffness=stiffness,
        damping=stiffness * described.damping_time,
    )


def _add_joints(
    body, module: MismatchedModule, number: int, segment: int, fidelity: Fidelity
) -> None:
    length = module.described.length / fidelity.segments
    damping_time = module.described.damping_time
    rest = module.rest_turns / fidelity.segments
    cubic = module.cubic(fidelity.segments)
    hinges = list(enumerate("xyz" if fidelity.torsion else "xy"))
    if fidelity.torsion and (number * fidelity.segments + segment) % 2:
        # turns do not commute; in one order all along, bends would add up to a twist of
        # first order
        hinges.reverse()
    for turn, axis in hinges:
        stiffness = module.stiffnesses[turn] / length
        body.add_joint(
            name=joint_name(number, segment, axis),
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=module.axes[turn],
            # of the turn, its square, its cube
            stiffness=(stiffness, 0.0, cubic[turn]),
            springref=rest[turn],
            damping=stiffness * damping_time,
            armature=_ARMATURE,
        )


def _set_inertia(
    body,
    own: tuple[MismatchedModule, float],
    following: tuple[MismatchedModule, float] | None,
    payload: float,
) -> None:
    """Mass, center and inertia of two half segments (thin solid cylinders), at the tip of one and a point mass."""
    half = own[1]
    pieces = [
        (
            module.mass * length / module.described.length,
            start,
            length,
            module.described.cable_radius,
        )
        for (module, length), start in (
            (own, 0.0),
            *([(following, half)] if following else ()),
        )
    ]
    if following is None:
        pieces.append((payload, half, 0.0, 0.0))
    masses, starts, lengths, radii = np.array(pieces).T
    centers = starts + lengths / 2
    center = masses @ centers / masses.sum()
    across = np.sum(masses * (lengths**2 / 12 + radii**2 / 4 + (centers - center) ** 2))
    body.mass = masses.sum()
    body.ipos = (0, 0, center)
    body.inertia = (across, across, np.sum(masses * radii**2 / 2))
    body.explicitinertial = True


def _add_cable_sites(
    body,
    arm: ArmSpec,
    modules: list[MismatchedModule],
    place: tuple[int, int],
    height: float,
) -> None:
    """Points that cables pass at one place, a station of a module: its own, and those of above that run through."""
    for owner, module in enumerate(modules):
        share = passed_shares(arm, owner).get(place[0])
        for cable, (x, y) in enumerate(module.cables if share is not None else ()):
            body.add_site(
                name=_eye(owner, cable, place), pos=(share * x, share * y, height)
            )


def _eye(owner: int, cable: int, place: tuple[int, int]) -> str:
    return f"eye_{owner}_{cable}_{place[0]}_{place[1]}"


def _add_cables(spec: mujoco.MjSpec, arm: ArmSpec, fidelity: Fidelity) -> None:
    geometry = ArmGeometry.of(arm)
    modules = [MismatchedModule.of(module) for module in arm.modules]
    for owner, cable in np.ndindex(geometry.pretensions.shape):
        tendon = spec.add_tendon(name=f"cable_{owner}_{cable}")
        shares = passed_shares(arm, owner)
        rest_length = 0.0
        if fidelity.routed_cables:
            for place in product(shares, range(fidelity.segments + 1)):
                tendon.wrap_site(_eye(owner, cable, place))
            rest_length = _straight_length(arm, modules[owner].cables[cable], shares)
        else:
            _lead_along_joints(tendon, arm, fidelity.segments, owner, cable)
        pull = _add_pull(spec, tendon.name, arm.modules[owner].cable.viscous_friction)
        if arm.actuation == "displacement":
            _stretch(
                pull,
                arm.modules[owner].cable.stiffness,
                rest_length,
                float(geometry.pretensions[owner, cable]),
            )


def _straight_length(
    arm: ArmSpec, cable: np.ndarray, shares: dict[int, float]
) -> float:
    """Of a cable along the straight arm, which steps outward to the module that it ends in."""
    steps = np.abs(np.diff(list(shares.values()))) * np.linalg.norm(cable)
    return sum(arm.modules[number].length for number in shares) + float(steps.sum())


def _lead_along_joints(
    tendon, arm: ArmSpec, segments: int, owner: int, cable: int
) -> None:
    """A constant lever arm about every hinge that the cable passes, and the whole way of every slide."""
    for number, share in passed_shares(arm, owner).items():
        levers = MismatchedModule.of(arm.modules[owner]).levers_about(
            MismatchedModule.of(arm.modules[number]).axes
        )[cable]
        for segment in range(segments):
            for axis, lever in (("y", levers[1]), ("x", levers[0])):
                tendon.wrap_joint(
                    joint_name(number, segment, axis), float(share * lever)
                )
        if arm.modules[number].mismatch.axial_stiffness is not None:
            tendon.wrap_joint(slide_name(number), 1.0)


def _add_pull(spec: mujoco.MjSpec, name: str, viscous_friction: float):
    """An actuator that only pulls, with a commanded tension less friction against its motion."""
    pull = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    pull.forcelimited = True
    pull.forcerange = (-_MAX_TENSION, 0.0)
    pull.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    pull.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    pull.gainprm[0] = -1.0
    pull.biasprm[2] = -viscous_friction
    return pull


def _stretch(pull, stiffness: float, rest_length: float, pretension: float) -> None:
    """Let it pull by a spring behind a commanded displacement instead."""
    pull.gainprm[0] = stiffness
    pull.biasprm[0] = stiffness * rest_length - pretension
    pull.biasprm[1] = -stiffness
