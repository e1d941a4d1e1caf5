"""Range and rates of the commands in a log."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.episodes import Episode
from s2c2a.logs.command_range import describe_range, range_lines, rate_lines

TWIN = load_arm("twin_arm")


def value(line: str) -> float:
    """Number of a line such as `key = 1.0  # remark`."""
    return float(line.split("=")[1].split("#")[0])


def test_the_travel_holds_what_cables_have_in_common():
    commands = 0.0123456 * np.array([[-1, -1, -0.9], [0.2, 0.1, -0.3]])
    *_, line = range_lines(commands, "displacement", 0.01)
    assert line.startswith("travel = 0.01235  # the log's is 0.01235;")
    assert line.endswith("common to all cables 0.01193")


def test_the_travel_reaches_the_bend_limit_and_stays_plausible():
    commands = np.full((2, 3), 1e-5)
    assert value(range_lines(commands, "displacement", 0.02)[-1]) == 0.02
    assert value(range_lines(commands, "displacement", 0.0)[-1]) == 0.0005
    assert value(range_lines(9.0 + commands, "displacement", 0.0)[-1]) == 2.0


def test_a_tension_arm_has_a_range_of_tension():
    lines = range_lines(np.array([[0.0, 3.001, 1.0]]), "tension", 0.02)
    assert [value(line) for line in lines] == [3.01]
    assert lines[0].startswith("tension_range")


def swing(steps_deg: list[float]) -> np.ndarray:
    """Commands whose first module bends by these steps."""
    geometry = ArmGeometry.of(TWIN)
    bends = np.zeros((len(steps_deg), 3, 2))
    bends[:, 0, 0] = np.deg2rad(np.cumsum(steps_deg))
    return geometry.actions_at(bends / geometry.action_bends[:, None])


def test_rates_are_those_of_the_moving_steps_without_single_jumps():
    """A hold, then steps of 2 deg there and back, and one jump."""
    steps = [0.0] * 500 + [2.0, 2.0, -2.0, -2.0] * 100 + [40.0]
    step, acceleration = rate_lines(TWIN, [swing(steps)], moving=True)
    assert value(step) == pytest.approx(2.0)
    assert value(acceleration) == pytest.approx(4.0)


def test_poses_at_rest_show_no_acceleration_and_random_ones_no_large_step():
    (line,) = rate_lines(TWIN, [swing([30.0, -30.0] * 20)], moving=False)
    assert value(line) == 20.0


def test_the_shortest_logs_have_the_least_step():
    for count in (1, 2):
        still = np.zeros((count, 3, 3))
        assert value(*rate_lines(TWIN, [still], moving=True)) == 0.1


def test_rows_beyond_the_range_and_beyond_plans_are_named():
    actions = np.zeros((4, 3, 3))
    high = ArmGeometry.of(TWIN).action_high
    actions[0] = high
    actions[1, 0, 0] = 1.01 * high[0, 0]
    episode = Episode(TWIN, {"time": np.arange(4.0), "actions": actions})
    (line,) = describe_range([episode])
    assert line.startswith("range: 25 % of the steps have commands beyond the range of")
    assert "cable.travel" in line
    inside = Episode(TWIN, {"time": np.arange(2.0), "actions": 0.5 * actions[:2]})
    assert describe_range([inside]) == []


def test_commands_that_bend_more_than_plans_may_are_named():
    travel = float(ArmGeometry.of(TWIN).action_high.max())
    modules = [module.model_dump() for module in TWIN.modules]
    for module in modules:
        module["bend_limit_deg"] = 5.0
        module["cable"]["travel"] = travel
    arm = ArmSpec.model_validate(TWIN.model_dump() | {"modules": modules})
    shares = np.zeros((4, 3, 2))
    shares[0, 1, 0] = 1.0
    actions = ArmGeometry.of(arm).actions_at(shares)
    episode = Episode(arm, {"time": np.arange(4.0), "actions": actions})
    (line,) = describe_range([episode])
    assert line.startswith("range: 25 % of the steps have commands that hold larger")
    assert "bend_limit_deg" in line
