"""The live page in a real browser, where one is installed."""

import numpy as np

from conftest import until  # type: ignore[import-not-found]
from s2c2a.live.loop import Stage
from s2c2a.spaces import POSITION


def tip(loop):
    return loop.latest.states[-1, POSITION]


def test_target_dragged_by_mouse_takes_the_tip_along(loop, page, open_tab):
    tab = open_tab()
    until(lambda: loop.latest.stage is Stage.DRIVEN, what="driving")
    tab.page.get_by_text("Drag the violet ball").wait_for()
    tab.keep("at-rest-1280")
    before = tip(loop).copy()
    start = tab.place_of(loop.wish.target, loop.arm.length)
    tab.drag(start, (start[0] + 110, start[1] + 40))
    until(lambda: np.linalg.norm(np.subtract(loop.wish.target, before)) > 0.05, what="a drag of the target")
    until(lambda: loop.latest.error < 0.02, what="the tip's arrival")
    assert np.linalg.norm(tip(loop) - before) > 0.05
    tab.keep("dragged-1280")
    assert tab.errors == []
