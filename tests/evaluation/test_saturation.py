"""Commands at the limits of their range are reported, with share and cable."""

import numpy as np
import pytest

from made_up import TWIN, made_up
from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.cli import run as run_command
from s2c2a.cli.main import main
from s2c2a.evaluation import describe_run_saturation, describe_saturation
from s2c2a.runtime.limits import CommandLimiter, CommandLimits, command_range
from s2c2a.spaces import Stage


def test_commands_within_the_range_are_not_mentioned():
    near = 0.999 * ArmGeometry.of(TWIN).action_high
    assert describe_saturation(TWIN, np.array([near, -near, 0 * near])) == ""
    assert describe_saturation(TWIN, np.zeros((0, 3, 3))) == ""


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_share_and_the_most_limited_cable_are_named(dtype):
    high = ArmGeometry.of(TWIN).action_high
    actions = np.zeros((8, 3, 3), dtype)
    actions[1, 2, 1] = high[2, 1]
    actions[2, 2, 1] = -high[2, 1]
    actions[2, 0, 0] = high[0, 0]
    assert describe_saturation(TWIN, actions) == (
        "commands were at a limit of their range in 25 % of the steps, most often "
        "cable 2 of module 3: motion nearer to rest needs less, and a larger "
        "cable.travel in the arm file allows more, if the arm bears it, after new training"
    )
    rare = np.zeros((100, 3, 3), dtype)
    rare[:2] = high
    assert describe_saturation(TWIN, rare) == ""


def test_a_command_that_the_limiter_cuts_counts_and_one_that_it_slows_does_not():
    limiter = CommandLimiter(CommandLimits.of(TWIN))
    desired = 2.0 * ArmGeometry.of(TWIN).actions_at(np.eye(3)[:, :2])
    first = limiter.limit(desired)
    assert describe_saturation(TWIN, first) == ""
    for _ in range(100):
        last = limiter.limit(desired)
    assert "in 100 % of the steps" in describe_saturation(TWIN, last)


def test_only_the_steps_of_the_run_count():
    actions = np.zeros((4, 3, 3))
    actions[3] = ArmGeometry.of(TWIN).action_high
    stage = np.array([Stage.RUN, Stage.RUN, Stage.RUN, Stage.RELEASE])
    assert describe_run_saturation(made_up(4, actions=actions, stage=stage)) == ""
    running = made_up(4, actions=actions, stage=np.full(4, Stage.RUN))
    assert "in 25 % of the steps" in describe_run_saturation(running)


def test_slack_cables_of_a_tension_arm_are_no_limit():
    arm = load_arm("simulated_arm")
    geometry = ArmGeometry.of(arm)
    assert (geometry.action_low == 0.0).all()
    slack = np.zeros_like(geometry.action_low)
    assert describe_saturation(arm, slack) == ""
    assert "tension_range" in describe_saturation(arm, geometry.action_high)


def test_servos_may_limit_more_than_the_cables():
    servos = {
        "ids": [[1, 2, 3], [4, 5, 6], [7, 8, 9]],
        "limits": {"displacement": 0.001},
    }
    arm = ArmSpec.model_validate(TWIN.model_dump() | {"servos": servos})
    low, high = command_range(arm)
    assert (low == -0.001).all()
    assert (high == 0.001).all()
    assert "servos.limits.displacement" in describe_saturation(arm, high)


def test_collect_names_the_share(tmp_path, monkeypatch, capsys):
    """Every command counts as limited."""
    monkeypatch.setattr("s2c2a.evaluation.saturation.EQUAL", 1.0)
    out = tmp_path / "short.episodes"
    main(["collect", "--out", str(out), "--episodes", "1", "--samples", "8"])
    assert "commands were at a limit of their range in 100 %" in capsys.readouterr().out


def test_run_describes_saturation():
    assert "describe_run_saturation" in run_command._report.__code__.co_names
