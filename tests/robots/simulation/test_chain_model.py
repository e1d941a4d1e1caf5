"""The compiled MuJoCo model, read back and compared with the arm's description."""

import mujoco
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, Module
from s2c2a.errors import S2C2AError
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot
from s2c2a.robots.simulation.chain import build_model, get_fidelity

LENGTHS, MASSES, STIFFNESSES = (0.1, 0.2, 0.3), (0.02, 0.05, 0.11), (0.3, 0.2, 0.1)
RADIUS, TORSION, DAMPING_TIME = 0.02, 0.07, 0.04


@pytest.fixture(scope="module")
def uneven(make_arm):
    """Three modules that share no number but the cable radius."""
    modules = tuple(
        Module(
            length=length,
            cable_radius=RADIUS,
            cable_angles_deg=(0.0, 120.0, 240.0),
            mass=mass,
            bending_stiffness=stiffness,
            torsional_stiffness=TORSION,
            damping_time=DAMPING_TIME,
        )
        for length, mass, stiffness in zip(LENGTHS, MASSES, STIFFNESSES, strict=True)
    )
    return make_arm().model_copy(update={"modules": modules})


@pytest.fixture(params=FIDELITIES.values(), ids=FIDELITIES)
def fidelity(request):
    """Each layout of the chain."""
    return request.param


@pytest.fixture
def built(uneven, fidelity):
    """The model of the uneven arm and its data, straight."""
    model = build_model(uneven, fidelity)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def segment_lengths(fidelity) -> np.ndarray:
    """Length of every segment, base first."""
    return np.repeat(LENGTHS, fidelity.segments) / fidelity.segments


def test_the_straight_arm_stands_along_z_with_module_ends_at_their_lengths(built):
    _, data = built
    ends = np.array([data.site(f"end_{module}").xpos for module in range(3)])
    bases = np.array([data.site(f"base_{module}").xpos for module in range(3)])
    np.testing.assert_allclose(
        ends, [[0, 0, 0.1], [0, 0, 0.3], [0, 0, 0.6]], atol=1e-12
    )
    np.testing.assert_allclose(bases, [[0, 0, 0], [0, 0, 0.1], [0, 0, 0.3]], atol=1e-12)


def test_everything_but_the_clamped_half_segment_has_its_mass(built, fidelity):
    clamped = MASSES[0] / fidelity.segments / 2
    assert built[0].body_mass.sum() == pytest.approx(sum(MASSES) - clamped)


def test_the_moment_of_inertia_about_the_base_is_that_of_the_rods(built, fidelity):
    """Sum of m/L (z1^3 - z0^3)/3 + m r^2/4, less the clamped half segment."""
    model, data = built
    across = model.body_inertia[:, 0] + model.body_mass * data.xipos[:, 2] ** 2
    start, expected = 0.0, 0.0
    for length, mass in zip(LENGTHS, MASSES, strict=True):
        expected += (
            mass / length * ((start + length) ** 3 - start**3) / 3
            + mass * RADIUS**2 / 4
        )
        start += length
    half = LENGTHS[0] / fidelity.segments / 2
    expected -= MASSES[0] / LENGTHS[0] * (half**3 / 3 + half * RADIUS**2 / 4)
    assert across.sum() == pytest.approx(expected)


def test_the_moment_of_inertia_about_the_axis_is_that_of_cylinders(built, fidelity):
    moving = sum(MASSES) - MASSES[0] / fidelity.segments / 2
    assert built[0].body_inertia[:, 2].sum() == pytest.approx(moving * RADIUS**2 / 2)


def test_a_payload_adds_its_mass_at_the_tip(uneven, fidelity):
    bare, loaded = (build_model(uneven, fidelity, payload) for payload in (0.0, 0.4))
    tip = bare.site_bodyid[bare.site("end_2").id]
    added = loaded.body_mass - bare.body_mass
    assert added[tip] == pytest.approx(added.sum()) == pytest.approx(0.4)
    end = bare.site("end_2").pos[2]
    moment = bare.body_mass[tip] * bare.body_ipos[tip, 2] + 0.4 * end
    assert loaded.body_ipos[tip, 2] == pytest.approx(moment / loaded.body_mass[tip])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_hinge_stiffness_is_rigidity_over_segment_length(uneven, axis):
    """EI/h about x and y, GJ/h about z; damping is stiffness times the damping time."""
    accurate = get_fidelity("accurate")
    model = build_model(uneven, accurate)
    rigidity = np.full(3, TORSION) if axis == "z" else np.array(STIFFNESSES)
    hinges = [
        model.joint(f"joint_{module}_{segment}_{axis}")
        for module in range(3)
        for segment in range(10)
    ]
    expected = np.repeat(rigidity, 10) / segment_lengths(accurate)
    stiffness = [float(hinge.stiffness[0]) for hinge in hinges]
    np.testing.assert_allclose(stiffness, expected)
    damping = [model.dof_damping[hinge.dofadr[0]] for hinge in hinges]
    np.testing.assert_allclose(damping, expected * DAMPING_TIME)
    axes = model.jnt_axis[[hinge.id for hinge in hinges]]
    np.testing.assert_array_equal(axes, [np.eye(3)["xyz".index(axis)]] * 30)


@pytest.mark.parametrize("coupled", [False, True])
def test_routed_cables_start_at_the_module_or_where_coupled_at_the_base(
    make_arm, coupled
):
    accurate = get_fidelity("accurate")
    model = build_model(make_arm(coupled_cables=coupled), accurate)
    lengths = model.tendon_length0.reshape(3, 3)
    expected = [[0.2], [0.4], [0.6]] if coupled else [[0.2]] * 3
    np.testing.assert_allclose(lengths, np.repeat(expected, 3, axis=1))


def test_cables_run_at_their_angles_on_their_radius(twin):
    model = build_model(twin, get_fidelity("accurate"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    angles = np.deg2rad([[0, 120, 240], [60, 180, 300], [0, 120, 240]])
    eyes = np.array(
        [
            [data.site(f"eye_{owner}_{cable}_{owner}_3").xpos for cable in range(3)]
            for owner in range(3)
        ]
    )
    expected = 0.027 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    np.testing.assert_allclose(eyes[..., :2], expected, atol=1e-12)


@pytest.mark.parametrize("rate", [0.5, 3, 7, 10, 30, 60, 333, 1000])
def test_the_physics_step_divides_the_control_period_and_is_fine_enough(
    make_arm, fidelity, rate
):
    arm = make_arm(control_rate=rate)
    step = build_model(arm, fidelity).opt.timestep
    assert step <= (fidelity.explicit_time_step or fidelity.time_step) * (1 + 1e-9)
    assert arm.control_period / step == pytest.approx(
        round(arm.control_period / step), abs=1e-9
    )


def with_cables_of(arm, stiffness):
    """The arm with every cable so stiff [N/m]."""
    modules = [
        module.model_copy(
            update={"cable": module.cable.model_copy(update={"stiffness": stiffness})}
        )
        for module in arm.modules
    ]
    return arm.model_copy(update={"modules": tuple(modules)})


@pytest.mark.parametrize(
    ("stiffness", "integrator"),
    [(4500.0, "IMPLICITFAST"), (3e4, "DISCRETE"), (1e6, "DISCRETE")],
)
def test_only_soft_springs_are_explicit_and_the_arm_is_stable_with_any(
    twin, stiffness, integrator
):
    arm = with_cables_of(twin, stiffness)
    geometry, random = ArmGeometry.of(arm), np.random.default_rng(0)
    robot = SimulatedRobot(arm, "accurate")
    expected = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    assert robot.model.opt.integrator == expected
    robot.open()
    for _ in range(5):
        robot.step(random.uniform(geometry.action_low, geometry.action_high))
    assert np.isfinite(robot.states()).all()


def test_a_new_payload_can_change_integrator_and_physics_step(twin):
    """A payload lowers the highest frequency enough; the control period stays."""
    robot = SimulatedRobot(with_cables_of(twin, 15e3), "accurate")
    neutral = ArmGeometry.of(twin).action_neutral
    robot.open()
    before = robot.model.opt.integrator, robot.model.opt.timestep
    robot.set_payload(0.3)
    after = robot.model.opt.integrator, robot.model.opt.timestep
    assert before == (mujoco.mjtIntegrator.mjINT_DISCRETE, pytest.approx(0.1 / 50))
    assert after == (mujoco.mjtIntegrator.mjINT_IMPLICITFAST, pytest.approx(0.1 / 34))
    robot.step(neutral)
    assert robot.read().time == pytest.approx(twin.control_period)


def test_an_unknown_fidelity_is_rejected_with_the_choices(twin):
    with pytest.raises(S2C2AError, match=r"'superb'.*fast, accurate"):
        SimulatedRobot(twin, "superb")
