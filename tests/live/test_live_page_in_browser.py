"""The live page in a real browser, where one is installed. `S2C2A_SCREENSHOTS` names a folder to keep what is seen."""

import time

import numpy as np
import pytest

from s2c2a.cli.live import running_page
from s2c2a.live.request import Obstacle
from s2c2a.live.window import across_the_screen
from s2c2a.spaces import POSITION, Stage

from live_tabs import TALL, WIDE, Tab, drawn_tip, until  # type: ignore[import-not-found]


def tip(control):
    return control.latest.states[-1, POSITION].copy()


def drag_until(tab, start, end, done, what: str) -> None:
    """Drag, again if need be: a page without a graphics card may draw a thing seconds after it is there."""
    for _ in range(5):
        tab.drag(start, end)
        for _ in range(20):
            if done():
                return
            time.sleep(0.05)
        time.sleep(1.0)
    pytest.fail(f"{what} has not happened in five tries")


def shown(tab):
    """The tab once its panel and scene are there."""
    tab.page.get_by_text("Drag the violet ball").wait_for()
    with_close = tab.page.locator(".mantine-Notification-closeButton")
    if with_close.count():
        with_close.first.click()  # that there is no graphics card
    return tab


def test_the_target_is_dragged_by_mouse_and_the_tip_goes_there(control, page, open_tab):
    tab = shown(open_tab())
    tab.keep("wide-at-rest")
    before, start = tip(control), tab.place_of(control.request.target, control.arm)
    end = (start[0] + 120, start[1] + 50)
    drag_until(
        tab,
        start,
        end,
        lambda: np.linalg.norm(np.subtract(control.request.target, before)) > 0.05,
        "the drag",
    )
    until(
        lambda: (
            np.abs(
                np.subtract(tab.place_of(control.request.target, control.arm), end)
            ).max()
            < 12
        ),
        what="the target's arrival under the mouse, which sends where it is a moment after it has been there",
    )
    until(lambda: control.latest.error < 0.02, what="the tip's arrival")
    assert np.linalg.norm(tip(control) - before) > 0.05
    until(
        lambda: np.abs(drawn_tip(page.scene) - tip(control)).max() < 0.01,
        what="the picture's arrival, which is a control step late while the arm moves",
    )
    tab.keep("wide-dragged")
    assert tab.errors == []


def test_the_page_of_the_command_is_there_before_its_arm_and_then_alive(
    chromium, tmp_path
):
    """The arm's control in a process of its own, as `s2c2a live` has it."""
    said, tabs = [], []

    def look(text: str) -> None:
        said.append(text)
        if "http" in text:
            tabs.append(Tab(chromium, text.split()[-1]))

    with running_page("twin_arm", port=0, out=tmp_path, said=look) as (control, _):
        tab = shown(tabs[0])
        assert [text.split()[0] for text in said] == ["open", "twin_arm"]
        start = tab.place_of(control.request.target, control.arm)
        end = (start[0] - 110, start[1] + 40)
        drag_until(
            tab, start, end, lambda: control.request.target[0] != 0.0, "the drag"
        )
        until(lambda: control.latest.error < 0.02, what="the tip's arrival")
        tab.stop()
        until(lambda: control.latest.stage is Stage.HOLD, what="stopping")
        tab.page.get_by_role("tab", name="Plan").click()
        tab.page.get_by_text("Driven by").wait_for()
        assert control.strategies == ("s2c2a · best", "pcc · best", "pcc · paper")
        assert tab.errors == []
        tab.page.close()
        until(lambda: not control.request.driven, what="letting go")


def test_sliders_act(control, page, open_tab):
    tab = shown(open_tab())
    tab.page.get_by_role("tab", name="Faults").click()
    thumb = tab.page.get_by_role("slider").nth(1)
    thumb.wait_for()
    tab.keep("wide-faults")
    thumb.focus()
    for _ in range(12):
        tab.page.keyboard.press("ArrowRight")
    until(lambda: control.request.push[0] > 0.5, what="the push")
    until(lambda: tip(control)[0] > 0.01, what="giving way")
    tab.page.get_by_role("button", name="No faults").click()
    until(lambda: control.request.push == (0.0, 0.0, 0.0), what="the end of the push")
    tab.page.get_by_role("tab", name="Plan").click()
    tab.page.get_by_role("slider").first.wait_for()
    tab.keep("wide-plan")
    tab.stop()
    until(lambda: control.latest.stage is Stage.HOLD, what="the stop")
    assert tab.errors == []


def test_an_obstacle_pushed_into_the_arm_makes_it_flee(control, page, open_tab):
    tab = shown(open_tab())
    control.ask(target=None)
    tab.page.get_by_role("tab", name="Avoid").click()
    tab.page.get_by_role("button", name="Add one").click()
    until(lambda: len(control.request.obstacles) == 1, what="the obstacle")
    control.ask(
        obstacles=(
            Obstacle(tuple(0.22 * across_the_screen(control.arm) + (0, 0, 0.58)), 0.08),
        )
    )
    until(lambda: control.latest.clearance < 1.0, what="the obstacle")
    before = tip(control)
    tab.keep("wide-obstacle")
    start = tab.place_of(control.request.obstacles[0].center, control.arm)
    end = tab.place_of(
        0.02 * across_the_screen(control.arm) + (0, 0, 0.58), control.arm
    )
    drag_until(
        tab, start, end, lambda: np.linalg.norm(tip(control) - before) > 0.02, "fleeing"
    )
    until(lambda: control.latest.clearance > 0, what="being clear")
    tab.keep("wide-fled")
    assert tab.errors == []


def test_the_second_browser_watches_until_the_handle_is_free(control, page, open_tab):
    first = shown(open_tab())
    second = open_tab()
    second.page.get_by_text("Somebody else drives").wait_for()
    assert second.page.get_by_role("tab", name="Faults").count() == 0
    driver = page.session.driver
    second.keep("wide-watching")
    start = second.place_of(control.request.target, control.arm)
    target = control.request.target
    second.drag(start, (start[0] + 120, start[1] + 50))
    time.sleep(1.0)
    assert control.request.target == target
    first.page.get_by_role("tab", name="More").click()
    first.page.get_by_role("button", name="Let others drive").click()
    second.page.get_by_role("button", name="Take the handle").click()
    until(lambda: page.session.driver not in (None, driver), what="taking the handle")
    assert first.errors == second.errors == []


def test_out_of_reach_is_shown_on_a_telephone_too(control, page, open_tab):
    tab = shown(open_tab(TALL))
    control.ask(target=(0.22, -0.12, 0.63))
    tab.page.get_by_text("cm out of reach").first.wait_for()
    until(lambda: page._gap > 0.01, what="the distance left")
    time.sleep(2.0)
    tab.keep("tall-out-of-reach")
    assert tab.errors == []


@pytest.mark.parametrize("size", [WIDE, TALL])
def test_stop_is_there_for_whoever_watches_and_with_the_panel_folded_and_escape_stops_too(
    control, page, open_tab, size
):
    first, watcher = shown(open_tab()), open_tab(size)
    watcher.page.get_by_text("Somebody else drives").wait_for()
    name = "tall" if size == TALL else "wide"
    watcher.page.get_by_text("s2c2a · twin_arm").first.click()  # folds the panel
    until(
        lambda: not watcher.page.get_by_text("Somebody else drives").is_visible(),
        what="folding",
    )
    time.sleep(1.0)
    watcher.keep(f"{name}-watching-folded")
    watcher.stop()
    until(lambda: control.latest.stage is Stage.HOLD, what="the watcher's stop")
    watcher.page.get_by_role("button", name="Stopped").wait_for()
    assert watcher.page.get_by_role("button", name="Go on").count() == 0
    first.page.get_by_text("looks at this page").wait_for()
    first.keep(f"{name}-stopped-by-another")
    first.page.get_by_role("button", name="Go on").click()
    until(lambda: control.latest.stage is Stage.RUN, what="going on")
    watcher.page.keyboard.press("Escape")
    until(lambda: control.latest.stage is Stage.HOLD, what="the key")
    assert first.errors == watcher.errors == []
