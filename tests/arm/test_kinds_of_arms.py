"""Arms of all kinds: modules with different numbers of cables, planar, passive, pressure."""

import jax.numpy as jnp
import numpy as np
import pytest

from held_arm import settled
from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.arm.geometry import cables_present
from s2c2a.errors import ArmError
from s2c2a.evaluation import describe_saturation
from s2c2a.goals import Goal
from s2c2a.kinematics import PCC, commanded_part
from s2c2a.models.layers import SumAndRange
from s2c2a.planning import reach_gaps
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime.conformance import check_robot
from s2c2a.runtime.limits import CommandLimits
from s2c2a.spaces import POSITION
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.strategies.pcc import PlainPCC

FOUR = [0.0, 90.0, 180.0, 270.0]
THREE = [20.0, 140.0, 260.0]
OPPOSED = [30.0, 210.0]


def arm_of(make_arm, *angles, **table):
    """An arm with these cables."""
    arm = make_arm(modules=len(angles), **table)
    described = arm.model_dump()
    for module, row in zip(described["modules"], angles, strict=True):
        module["cable_angles_deg"] = row
    return ArmSpec.model_validate(described)


@pytest.fixture(params=["mixed", "planar", "passive", "pneumatic_arm", "planar_finger"])
def arm(request, make_arm):
    """An arm of each kind."""
    angles = {"mixed": (FOUR, THREE), "planar": (OPPOSED, FOUR), "passive": ([], THREE)}
    if request.param in angles:
        return arm_of(make_arm, *angles[request.param])
    return load_arm(request.param)


def shares_of(arm):
    """Shares of the full bend in all directions, that the cables command."""
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    shares = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    every = np.broadcast_to(shares[:, None], (24, arm.module_count, 2))
    return np.asarray(commanded_part(every, ArmGeometry.of(arm).steerable))


def test_actions_hold_the_bends_that_they_are_for(arm):
    geometry = ArmGeometry.of(arm)
    shares = shares_of(arm)
    actions = geometry.actions_at(shares)
    bends = geometry.commanded_bends(actions)
    expected = shares * geometry.action_bends[:, None]
    np.testing.assert_allclose(bends, expected, atol=1e-5)
    span = np.abs(geometry.action_scale).max()
    assert (actions >= geometry.action_low - 1e-6 * span).all()
    assert (actions <= geometry.action_high + 1e-6 * span).all()
    assert (actions[:, ~cables_present(arm)] == 0.0).all()


def test_plain_kinematics_and_networks_agree_on_actions(arm):
    geometry = ArmGeometry.of(arm)
    pcc = PCC.of(arm)
    bends = 0.2 * shares_of(arm)
    np.testing.assert_allclose(pcc.bends(pcc.actions(bends)), bends, atol=1e-5)
    layer = SumAndRange.of(arm)
    matrices = jnp.asarray(geometry.cable_matrices)
    normalized = jnp.einsum("mck,dmk->dmc", matrices, 0.3 * shares_of(arm))
    actions = layer.actions(normalized)
    np.testing.assert_allclose(layer.normalized(actions), normalized, atol=1e-5)
    np.testing.assert_allclose(layer.limited(normalized), normalized, atol=1e-5)


def test_the_simulation_bends_every_module_as_commanded(arm):
    share = 0.5 * shares_of(arm)[2]
    robot = settled(arm, ArmGeometry.of(arm).actions_at(share), seconds=3.0)
    axes = robot.configurations()[:, :2]
    commanded = np.linalg.norm(share, axis=-1) > 0.0
    cosines = np.sum(axes * share, axis=-1)[commanded]
    sizes = np.linalg.norm(axes, axis=-1) * np.linalg.norm(share, axis=-1)
    assert (cosines > 0.95 * sizes[commanded]).all()
    assert (np.linalg.norm(axes, axis=-1)[commanded] > 0.05).all()
    cables = robot.read().sensors["cables"]
    assert (cables[~cables_present(arm)] == 0.0).all()


def test_each_kind_conforms_as_a_robot(arm):
    assert check_robot(SimulatedRobot(arm))


def test_the_output_layer_drives_the_cables_that_exist_and_no_others(arm):
    layer = SumAndRange.of(arm)
    raw = jnp.linspace(-1.0, 1.0, arm.module_count * arm.cable_count)
    actions = np.asarray(layer(raw.reshape(arm.module_count, arm.cable_count)))
    assert (actions[~cables_present(arm)] == 0.0).all()
    geometry = ArmGeometry.of(arm)
    bends = geometry.bends_of(actions)
    directions = np.einsum("mck,mk->mc", geometry.cable_matrices, bends)
    np.testing.assert_allclose(actions, directions, atol=1e-6)


def test_limits_let_every_arm_move_as_fast_as_plans(arm):
    geometry = ArmGeometry.of(arm)
    limits = CommandLimits.of(arm)
    steps = int(0.8 * geometry.action_bends.min() / geometry.step_limit)
    share = shares_of(arm)[2] * geometry.step_limit / geometry.action_bends[:, None]
    last = before = geometry.action_neutral
    change = np.zeros_like(last)
    for step in range(1, steps + 1):
        desired = geometry.actions_at(step * share)
        sent = limits.limited(desired, last, change, before)
        last, change, before = sent, sent - last, desired
    bends = geometry.commanded_bends(last)
    wanted = steps * share * geometry.action_bends[:, None]
    np.testing.assert_allclose(bends, wanted, atol=2.0 * geometry.step_limit)


def test_absent_cables_are_at_no_limit(arm):
    geometry = ArmGeometry.of(arm)
    rest = np.broadcast_to(geometry.action_neutral, (5, *geometry.action_neutral.shape))
    assert describe_saturation(arm, rest) == ""


@pytest.mark.slow
def test_a_plan_of_a_planar_arm_stays_in_its_plane():
    arm = load_arm("planar_finger")
    strategy = PlainPCC().build(arm, recipe_named("best"), None, RunOptions())
    robot = SimulatedRobot(arm)
    reading = robot.open()
    goal = Goal.of(2).with_position((0.04, 0.03, 0.09))
    strategy.start(reading)
    for _ in range(20):
        robot.step(strategy.step(reading, goal))
        reading = robot.read()
    tip = robot.states()[-1, POSITION]
    assert abs(tip[1]) < 1e-4
    assert tip[0] == pytest.approx(0.04, abs=0.015)
    (gap,) = reach_gaps(arm, np.array([[0.04, 0.03, 0.09]]))
    assert gap > 0.02


def test_more_pressure_in_all_chambers_bends_nothing():
    arm = load_arm("pneumatic_arm")
    geometry = ArmGeometry.of(arm)
    actions = geometry.actions_at(np.array([[0.3, 0.1], [0.0, -0.2]]))
    assert actions.min() == pytest.approx(0.0, abs=1e-6)
    more = geometry.commanded_bends(actions + 5000.0)
    np.testing.assert_allclose(more, geometry.commanded_bends(actions), atol=1e-9)


@pytest.mark.parametrize(
    ("angles", "remedy"),
    [
        ((FOUR, [0.0]), "two opposed cables"),
        ((FOUR, [0.0, 90.0]), "gap of 270 deg"),
        (([], []), "no module has cables"),
    ],
)
def test_cables_that_cannot_pull_back_are_refused(make_arm, angles, remedy):
    with pytest.raises(ValueError, match=remedy):
        arm_of(make_arm, *angles)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"pressure_limit": None}, "pressure_limit is missing"),
        ({"chamber_area": None}, "chamber_area is missing"),
        ({"rest_pressure": 60000.0}, "not below pressure_limit"),
        ({"pretension": 3.0}, "rest_pressure"),
        ({"cable": {"backlash": 0.001}}, "act on displacement"),
        ({"cable": {"travel": 0.01}}, "use pressure_limit"),
    ],
)
def test_keys_of_cables_are_refused_for_chambers(change, cause):
    described = load_arm("pneumatic_arm").model_dump()
    described["modules"][1].update(change)
    with pytest.raises((ValueError, ArmError), match=cause):
        ArmSpec.model_validate(described)
