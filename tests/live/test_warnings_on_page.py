"""The page shows a changed arm, the plan, and commands at their limits."""

from dataclasses import replace

import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.spaces import Stage


def test_a_tip_far_from_its_predictions_is_shown(control, page):
    page._disagreement.text = "the tip was 15.0 mm from its predictions"
    assert "**the tip was 15.0 mm" in page._status_of(control.latest)


def test_the_planned_way_is_drawn_ahead_of_the_tip(control, page, monkeypatch):
    drawn = {}
    monkeypatch.setattr(page.scene, "draw_trail", drawn.__setitem__)
    way = np.linspace([0.0, 0.0, 0.6], [0.1, 0.0, 0.55], 12)
    step = replace(control.latest.step, diagnostics={"horizon": way})
    page._draw_trails(replace(control.latest, step=step))
    np.testing.assert_array_equal(drawn["horizon"], way)
    page._draw_trails(control.latest)
    assert not len(drawn["horizon"])


def test_every_step_is_compared_with_its_prediction_also_between_two_frames(
    control, page, monkeypatch
):
    seen = []
    monkeypatch.setattr(page._disagreement, "add", seen.extend)
    page._watched.clear()
    latest = control.latest
    # numbers of no step of the loop, which goes on meanwhile
    steps = [replace(latest.step, number=number) for number in (-3, -2, -1)]
    for step in steps:
        control._show(replace(latest, step=step))
    page._draw(0.0)
    assert [step.number for step in seen if step.number < 0] == [-3, -2, -1]


def test_commands_at_the_limit_of_their_range_are_shown(control, page):
    assert "at a limit" not in page._status_of(control.latest)
    high = ArmGeometry.of(page.arm).action_high
    page._watched.clear()
    step = replace(control.latest.step, stage=Stage.RUN, action=high)
    for stage in (Stage.HOLD, Stage.RUN):
        control._show(replace(control.latest, step=replace(step, stage=stage)))
    page._sent.clear()
    page._draw(0.0)
    assert "limit of their range in 100 % of the steps" in page._status_of(
        control.latest
    )
