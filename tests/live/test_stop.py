"""The page shows "stopped" only once the arm obeys."""

from dataclasses import replace

import pytest

from s2c2a.live.page import STOP_PRESSED
from s2c2a.spaces import Stage

from live_tabs import until  # type: ignore[import-not-found]


def test_stop_reports_stopped_when_the_arm_holds(control, page):
    control.ask(driven=True, target=(0.15, 0.0, 0.55))
    until(lambda: control.latest.stage is Stage.RUN, what="running")
    assert page._stop() == "Stopped"
    assert control.latest.stage is Stage.HOLD
    assert f"**stopped:** {STOP_PRESSED}" in page._status_of(control.latest)


@pytest.mark.parametrize(
    ("stage", "text"), [(Stage.RUN, "stopping"), (Stage.RELEASE, "going to rest")]
)
def test_a_moving_arm_is_not_called_stopped(control, page, stage, text):
    control.ask(stopped=True)
    moving = replace(control.latest, stage=stage)
    status = page._status_of(moving)
    assert text in status
    assert "stopped:" not in status
