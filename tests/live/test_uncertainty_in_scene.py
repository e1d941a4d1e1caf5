"""The ball of twice the predictive standard deviation around the predicted tip."""

import time
from dataclasses import replace

import numpy as np
import pytest

from s2c2a.live.browsers import GHOST
from s2c2a.live.page import LivePage
from s2c2a.live.window import Window

from light_control import light_control  # type: ignore[import-not-found]
from live_tabs import Tab, until  # type: ignore[import-not-found]

TIP = (0.1, 0.2, 0.4)


@pytest.fixture
def window(twin):
    """A window on the straight arm, without browsers."""
    opened = Window(twin).open(0)
    yield opened
    opened.close()


@pytest.fixture
def still_page(tmp_path):
    """A page of an arm without networks, whose frames the test draws."""
    control = light_control()
    control.start()
    page = LivePage(control, 0, tmp_path)
    until(lambda: page.frames > 0, what="the first frame")
    page.closing.set()
    page._drawing.join()
    yield page
    page.close()
    control.stop()


def test_the_ball_has_twice_the_deviation_and_is_moved_not_made_again(window):
    ball = window.scene._uncertainty
    for std in (0.01, 0.02):
        window.scene.draw_uncertainty(TIP, std)
        assert ball is window.scene._uncertainty
        assert ball.visible
        np.testing.assert_allclose(ball.scale, 2.0 * std)
        np.testing.assert_allclose(ball.position, TIP)


@pytest.mark.parametrize("std", [0.0, np.nan, np.inf])
def test_a_model_without_uncertainty_has_no_ball(window, std):
    window.scene.draw_uncertainty(TIP, 0.01)
    window.scene.draw_uncertainty(TIP, std)
    assert not window.scene._uncertainty.visible


@pytest.mark.slow
def test_a_target_inside_the_ball_can_be_dragged(window, twin, chromium):
    positions = []
    window.scene.on_drag(
        lambda _client, position: positions.append(position),
        *[lambda *_: None] * 3,
    )
    window.scene.draw_target(TIP, None)
    window.scene.draw_uncertainty(TIP, 0.05)
    tab = Tab(chromium, window.gate.address)
    start = np.array(tab.place_of(TIP, twin))
    tab.drag(start, start + np.array([60.0, -40.0]))
    until(lambda: positions, what="the drag")
    tab.page.close()


@pytest.mark.slow
def test_the_live_page_shows_the_ball_with_the_planned_arm(still_page):
    latest = still_page._control.latest
    predicted = np.array(latest.predicted)
    predicted[-1, :3] = TIP
    ball = still_page.scene._uncertainty

    def draw() -> None:
        step = replace(latest.step, moment=time.perf_counter())
        uncertain = replace(latest, step=step, predicted=predicted, predictive_std=0.01)
        still_page._snapshots.extend([uncertain, uncertain])
        still_page._draw_arm(uncertain)

    draw()
    assert ball.visible
    np.testing.assert_allclose(ball.position, TIP)
    still_page.browsers.view[GHOST] = False
    draw()
    assert not ball.visible
