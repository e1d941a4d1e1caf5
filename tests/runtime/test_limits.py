"""Limits of commands in value, rate, and acceleration, on arms of all kinds."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from s2c2a.arm import ArmGeometry
from s2c2a.arm.geometry import DEFAULT_ACCELERATION_RATIO
from s2c2a.runtime import CommandLimits
from s2c2a.runtime.limits import CommandLimiter, arm_at

SLACK = 1 + 1e-6
KINDS = st.fixed_dictionaries(
    {
        "tension": st.booleans(),
        "modules": st.integers(1, 3),
        "cables": st.integers(3, 5),
        "step": st.floats(0.5, 30.0),
        "turn": st.one_of(st.none(), st.floats(0.1, 3.0)),
    }
)
QUICK = settings(
    deadline=None, max_examples=25, suppress_health_check=list(HealthCheck)
)


def built(make_arm, kind):
    """Arm of a kind, its limits, and its geometry."""
    module = {"pretension": 3.0, "tension_range": 20.0} if kind["tension"] else None
    turn = None if kind["turn"] is None else max(0.001, kind["turn"] * kind["step"])
    arm = make_arm(
        kind["modules"],
        kind["cables"],
        module,
        actuation="tension" if kind["tension"] else "displacement",
        step_limit_deg=kind["step"],
        acceleration_limit_deg=turn,
    )
    return arm, CommandLimits.of(arm), ArmGeometry.of(arm)


def size_deg(change, geometry):
    """Size of a change of each module, computed independently [deg]."""
    parts = change / geometry.action_scale[:, None]
    pairs = zip(geometry.cable_matrices, parts, strict=True)
    bends = np.linalg.norm([np.linalg.pinv(b) @ p for b, p in pairs], axis=-1)
    return np.rad2deg(geometry.bend_limits) * np.maximum(
        bends, np.abs(parts).max(axis=-1)
    )


def random_commands(geometry, seed, count=40):
    """Arbitrary desired commands: far, near, constant, at a limit, not finite."""
    random = np.random.default_rng(seed)
    desired = geometry.action_neutral
    reach = np.abs(geometry.action_scale)[:, None]
    for _ in range(count):
        kind = random.integers(6)
        if kind == 0:
            far = random.normal(scale=3.0, size=desired.shape)
            desired = geometry.action_neutral + reach * far
        elif kind == 1:
            desired = desired + reach * random.normal(scale=0.05, size=desired.shape)
        elif kind == 2:
            lowest = random.random(desired.shape) < 0.5
            desired = np.where(lowest, geometry.action_low, geometry.action_high)
        elif kind == 3:
            lost = random.random(desired.shape) < 0.3
            value = random.choice([np.nan, np.inf, -np.inf])
            desired = np.where(lost, value, desired)
        yield desired


def follow(limits, desired_commands):
    """Limited commands from rest on, and their changes."""
    last = before = limits.rest.copy()
    change = np.zeros_like(limits.rest)
    commands, changes = [last], [change]
    for desired in desired_commands:
        command = limits.limited(desired, last, change, before)
        last, change, before = command, command - last, desired
        commands.append(last)
        changes.append(change)
    return np.array(commands), np.array(changes)


@QUICK
@given(KINDS, st.integers(0, 2**32))
@example({"tension": True, "modules": 1, "cables": 5, "step": 8.0, "turn": 0.2}, 1)
def test_no_step_exceeds_a_limit_whatever_is_desired(make_arm, kind, seed):
    arm, limits, geometry = built(make_arm, kind)
    commands, changes = follow(limits, random_commands(geometry, seed))
    tolerance = 1e-12 * np.abs(geometry.action_scale)[:, None]
    assert np.isfinite(commands).all()
    assert (commands >= geometry.action_low - tolerance).all()
    assert (commands <= geometry.action_high + tolerance).all()
    turn = np.rad2deg(geometry.acceleration_limit)
    for change, turned in zip(changes[1:], np.diff(changes, axis=0), strict=True):
        assert size_deg(change, geometry).max() <= arm.step_limit_deg * SLACK
        assert size_deg(turned, geometry).max() <= turn * SLACK


@QUICK
@given(KINDS, st.integers(0, 2**32))
def test_a_command_within_all_limits_stays_the_same_bit_for_bit(make_arm, kind, seed):
    """Slow steps around rest."""
    arm, limits, geometry = built(make_arm, kind)
    random = np.random.default_rng(seed)
    turn = (
        min(arm.step_limit_deg, arm.acceleration_limit_deg or np.inf)
        / np.rad2deg(geometry.bend_limits)[:, None]
    )
    reach = np.minimum(0.2 * turn, 0.1) * np.abs(geometry.action_scale)[:, None]
    desired = [
        geometry.action_neutral + reach * random.uniform(-1, 1, limits.rest.shape)
        for _ in range(10)
    ]
    desired = list(np.clip(desired, geometry.action_low, geometry.action_high))
    commands, _ = follow(limits, desired)
    np.testing.assert_array_equal(commands[1:], desired)


@pytest.fixture
def sluggish(make_arm):
    """Limits of a module: 4 deg a step and 0.5 deg of acceleration; its full bend."""
    kind = {"tension": False, "modules": 1, "cables": 3, "step": 4.0, "turn": 0.125}
    _, limits, geometry = built(make_arm, kind)
    return limits, np.array([[-1.0, 0.5, 0.5]]) * geometry.action_scale[:, None]


def test_a_plan_that_moves_on_steadily_is_followed_bit_for_bit_however_fast(sluggish):
    """At full rate, with an eighth of it as acceleration: no braking."""
    limits, full = sluggish
    speeds = np.concatenate([0.49 * np.arange(1, 9), [3.95] * 3])
    desired = [full * degrees / 50.0 for degrees in np.cumsum(speeds)]
    np.testing.assert_array_equal(follow(limits, desired)[0][1:], desired)


def test_a_plan_that_begins_too_fast_is_caught_up_without_overshoot(sluggish):
    limits, full = sluggish
    desired = [full * degrees / 50.0 for degrees in np.arange(2.0, 44.0, 2.0)]
    behind = np.array(desired) - follow(limits, desired)[0][1:]
    lag = behind[:, 0, 0] / full[0, 0] * 50.0
    assert lag[3] > 2.0
    assert lag.min() > -1e-9
    np.testing.assert_allclose(lag[-5:], 0.0, atol=1e-9)


@QUICK
@given(KINDS, st.integers(0, 2**32))
def test_a_constant_target_is_reached_on_a_straight_path_without_overshoot(
    make_arm, kind, seed
):
    arm, limits, geometry = built(make_arm, kind)
    random = np.random.default_rng(seed)
    desired = random.uniform(geometry.action_low, geometry.action_high)
    turn = min(arm.step_limit_deg, arm.acceleration_limit_deg or np.inf)
    most = 3 + 2 * np.sqrt(300.0 / turn) + 150.0 / arm.step_limit_deg
    commands, _ = follow(limits, [desired] * int(most))
    scale = np.abs(geometry.action_scale)
    np.testing.assert_allclose(commands[-1], desired, atol=1e-9 * scale.max())
    remaining = desired - commands
    assert (np.diff(np.abs(remaining), axis=0) <= 1e-9 * scale[:, None]).all()
    assert (remaining * remaining[0] >= -1e-12 * scale.max() ** 2).all()


def test_braking_from_full_rate_stops_at_the_target(sluggish):
    """4 deg a step, 0.5 deg of acceleration, from rest to the full bend."""
    limits, full = sluggish
    commands, _ = follow(limits, [full] * 30)
    degrees = 50.0 * commands[:, 0, 0] / full[0, 0]
    assert degrees[-1] == pytest.approx(50.0)
    assert degrees.max() <= 50.0 + 1e-9
    np.testing.assert_allclose(np.diff(degrees)[:8], 0.5 * np.arange(1, 9))
    assert np.abs(np.diff(degrees, 2)).max() <= 0.5 + 1e-9


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_request_no_change(twin, value):
    limits = CommandLimits.of(twin)
    last = 0.3 * limits.geometry.action_high
    desired = np.full_like(last, value)
    np.testing.assert_array_equal(
        limits.limited(desired, last, np.zeros_like(last), desired), last
    )
    desired[0] = limits.rest[0]
    moved = limits.limited(desired, last, np.zeros_like(last), desired)
    np.testing.assert_array_equal(moved[1:], last[1:])
    assert (np.abs(moved[0]) < last[0]).all()


def commands_to_rest(limits, last):
    """Commands of the return to rest."""
    commands, change = [last], np.zeros_like(last)
    while (limits.change_sizes(commands[-1] - limits.rest) > 1e-6).any() and len(
        commands
    ) < 2000:
        command = limits.towards_rest(commands[-1], change)
        change = command - commands[-1]
        commands.append(command)
    return np.array(commands)


@QUICK
@given(KINDS.map(lambda kind: kind | {"turn": None}), st.integers(0, 2**32))
def test_the_return_to_rest_takes_the_fewest_steps_for_all_modules(
    make_arm, kind, seed
):
    arm, limits, geometry = built(make_arm, kind)
    random = np.random.default_rng(seed)
    last = random.uniform(geometry.action_low, geometry.action_high)
    commands = commands_to_rest(limits, last)
    distances = np.array(
        [size_deg(command - limits.rest, geometry) for command in commands]
    )
    assert len(commands) - 1 == np.ceil(distances[0].max() / arm.step_limit_deg - 1e-9)
    remaining = distances / distances[0]
    np.testing.assert_allclose(
        remaining, remaining[:, :1] * np.ones(len(limits.rest)), atol=1e-6
    )


@QUICK
@given(KINDS, st.integers(0, 2**32))
def test_the_return_to_rest_is_within_the_limits_and_ends(make_arm, kind, seed):
    """Also from the middle of arbitrary motion."""
    arm, limits, geometry = built(make_arm, kind)
    commands, changes = follow(limits, random_commands(geometry, seed, 15))
    last = commands[-1]
    change = changes[-1]
    turn = np.rad2deg(geometry.acceleration_limit)
    most = (
        20
        + 4 * np.sqrt(300.0 / min(turn, arm.step_limit_deg))
        + 2 * 150.0 / arm.step_limit_deg
    )
    for _ in range(int(most)):
        command = limits.towards_rest(last, change)
        assert size_deg(command - last, geometry).max() <= arm.step_limit_deg * SLACK
        assert size_deg(command - last - change, geometry).max() <= turn * SLACK
        last, change = command, command - last
    np.testing.assert_allclose(
        last, limits.rest, atol=1e-6 * np.abs(geometry.action_scale).max()
    )


def test_a_gap_in_time_allows_no_larger_step(twin):
    """Limits count steps: after an hour the command still changes by 4 deg."""
    limits, geometry = CommandLimits.of(twin), ArmGeometry.of(twin)
    held = limits.rest.copy()
    for _ in range(3600):
        held = limits.limited(
            np.full_like(held, np.nan), held, np.zeros_like(held), held
        )
    moved = limits.limited(geometry.action_high, held, np.zeros_like(held), held)
    assert size_deg(moved - held, geometry).max() == pytest.approx(4.0)


def test_the_acceleration_limit_is_in_proportion_to_the_step_limit(twin):
    own = CommandLimits.of(twin)
    np.testing.assert_allclose(
        DEFAULT_ACCELERATION_RATIO * own.step_limit, own.acceleration_limit
    )


def test_faster_commands_have_the_same_speed_and_acceleration(twin):
    own = CommandLimits.of(twin)
    faster = CommandLimits.of(arm_at(twin, 5 * twin.control_rate))
    assert np.allclose(5 * faster.step_limit, own.step_limit)
    assert np.allclose(25 * faster.acceleration_limit, own.acceleration_limit)


def test_a_held_command_beyond_the_range_is_approached_from_the_first_step(make_arm):
    arm = make_arm(1, 3, None, actuation="displacement", step_limit_deg=4.0)
    geometry = ArmGeometry.of(arm)
    limiter = CommandLimiter(CommandLimits.of(arm))
    desired = 2.0 * geometry.actions_at(np.array([[1.0, 0.0]]))
    reachable = np.clip(desired, geometry.action_low, geometry.action_high)
    distances = [np.abs(reachable - limiter.limit(desired)).max() for _ in range(60)]
    assert (np.diff(distances) <= 1e-12).all()
    assert distances[-1] < 1e-9
