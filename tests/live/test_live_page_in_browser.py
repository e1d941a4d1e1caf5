"""The live page in a real browser, if one is installed."""

import time

import numpy as np
import pytest

from s2c2a.live.cli.live import running_page
from s2c2a.live.request import Obstacle
from s2c2a.live.window import across_the_screen
from s2c2a.spaces import POSITION, Stage

from live_tabs import TALL, WIDE, Tab, drawn_tip, until  # type: ignore[import-not-found]

pytestmark = pytest.mark.slow


def tip(control):
    return control.latest.states[-1, POSITION].copy()


def ready(tab):
    """The tab, once its panel has loaded."""
    tab.page.get_by_text("Drag the violet ball").wait_for()
    close = tab.page.locator(".mantine-Notification-closeButton")
    if close.count():
        close.first.click()  # viser's notice that there is no graphics card
    return tab


def test_the_target_is_dragged_by_mouse_and_the_tip_goes_there(control, page, open_tab):
    tab = ready(open_tab())
    before = tip(control)
    start = tab.place_of(control.request.target, control.arm)
    end = (start[0] + 120, start[1] + 50)
    tab.drag(start, end)

    def is_under_mouse() -> bool:
        place = tab.place_of(control.request.target, control.arm)
        return np.abs(np.subtract(place, end)).max() < 12

    until(is_under_mouse, what="the target under the mouse")
    until(lambda: control.latest.error < 0.05, what="the tip's arrival")
    assert np.linalg.norm(tip(control) - before) > 0.05
    until(
        lambda: np.abs(drawn_tip(page.scene) - tip(control)).max() < 0.01,
        what="the drawn arm",
    )
    assert tab.errors == []


def test_s2c2a_live_opens_its_page_before_the_arm_and_then_drives(chromium, tmp_path):
    """The control runs in a separate process."""
    texts = []
    tabs = []

    def look(text: str) -> None:
        texts.append(text)
        if "http" in text:
            tabs.append(Tab(chromium, text.split()[-1]))

    with running_page("twin_arm", port=0, out=tmp_path, on_message=look) as (
        control,
        _,
    ):
        tab = ready(tabs[0])
        assert [text.split()[0] for text in texts[:2]] == ["twin_arm", "open"]
        start = tab.place_of(control.request.target, control.arm)
        end = (start[0] - 110, start[1] + 40)
        tab.drag(start, end)
        until(lambda: control.request.target[0] != 0.0, what="the drag")
        until(lambda: control.latest.error < 0.05, what="the tip's arrival")
        tab.stop()
        until(lambda: control.latest.stage is Stage.HOLD, what="stopping")
        tab.page.get_by_role("tab", name="Plan").click()
        tab.page.get_by_text("Strategy").first.wait_for()
        assert control.strategies == ("s2c2a · best", "pcc · best", "pcc · paper")
        assert tab.errors == []
        tab.page.close()
        until(lambda: not control.request.driven, what="the end of driving")


def test_sliders_of_faults_disturb_the_arm(control, page, open_tab):
    tab = ready(open_tab())
    tab.page.get_by_role("tab", name="Faults").click()
    thumb = tab.page.get_by_role("slider").nth(1)
    thumb.wait_for()
    camera = next(iter(page.server.get_clients().values())).camera
    before = np.array(camera.position)
    thumb.focus()
    for _ in range(12):
        tab.page.keyboard.press("ArrowRight", delay=30)
    until(lambda: control.request.force[0] > 0.5, what="the force")
    assert np.allclose(camera.position, before), "the keys turned the camera"
    until(lambda: tip(control)[0] > 0.01, what="deflection")
    tab.page.get_by_role("button", name="Clear all faults").click()
    until(lambda: control.request.force == (0.0, 0.0, 0.0), what="the end of the force")
    tab.page.get_by_role("tab", name="Plan").click()
    tab.page.get_by_role("slider").first.wait_for()
    tab.stop()
    until(lambda: control.latest.stage is Stage.HOLD, what="the stop")
    assert tab.errors == []


def test_the_whole_arm_takes_a_shape_that_is_dragged(control, page, open_tab):
    tab = ready(open_tab())
    tab.page.get_by_text("Set the whole shape").click()
    until(lambda: control.request.shape is not None, what="the shape")
    side = across_the_screen(control.arm)
    # every module bends by 20 deg
    angles = np.deg2rad([20, 40, 60])[:, None]
    radius = control.arm.length / angles[-1]
    ends = radius * ((1 - np.cos(angles)) * side + np.sin(angles) * (0, 0, 1))
    control.ask(shape=[control.request.shape[0], ends[1]], target=ends[2])
    start = tab.place_of(control.request.shape[0], control.arm)
    until(lambda: control.latest.stage is Stage.RUN, what="the motion")
    tab.drag(start, tab.place_of(ends[0], control.arm))

    def error() -> float:
        # sag, which the light strategy does not know, moves the arm by 4 cm from its plan
        reached = control.latest.predicted[:, POSITION]
        wanted = np.array([*control.request.shape, control.request.target])
        return np.linalg.norm(reached - wanted, axis=-1).max()

    until(lambda: control.request.shape[0] @ side > 0.02, what="the drag")
    until(lambda: error() < 0.02, what="the shape")
    control.reset()
    until(lambda: control.request.shape is None, what="the reset")
    tab.page.get_by_text("Set the whole shape").wait_for()
    assert tab.errors == []


def test_the_arm_avoids_an_obstacle_that_is_dragged_into_it(control, page, open_tab):
    tab = ready(open_tab())
    control.ask(target=None)
    tab.page.get_by_role("tab", name="Avoid").click()
    tab.page.get_by_role("button", name="Add obstacle").click()
    until(lambda: len(control.request.obstacles) == 1, what="the obstacle")
    side = across_the_screen(control.arm)
    control.ask(obstacles=(Obstacle(tuple(0.22 * side + (0, 0, 0.58)), 0.08),))
    until(lambda: control.latest.clearance < 1.0, what="the obstacle")
    before = tip(control)
    start = tab.place_of(control.request.obstacles[0].center, control.arm)
    tab.drag(start, tab.place_of(0.02 * side + (0, 0, 0.58), control.arm))
    until(lambda: np.linalg.norm(tip(control) - before) > 0.02, what="motion")
    until(lambda: control.latest.clearance > 0, what="clearance")
    assert tab.errors == []


def test_the_second_browser_watches_until_control_is_released(control, page, open_tab):
    first = ready(open_tab())
    second = open_tab()
    second.page.get_by_text("Another browser drives").wait_for()
    assert second.page.get_by_role("tab", name="Faults").count() == 0
    driver = page.browsers.driver
    start = second.place_of(control.request.target, control.arm)
    target = control.request.target
    second.drag(start, (start[0] + 120, start[1] + 50))
    time.sleep(1.0)
    assert control.request.target == target
    first.page.get_by_role("tab", name="More").click()
    first.page.get_by_role("button", name="Let others drive").click()
    second.page.get_by_role("button", name="Take control").click()
    until(lambda: page.browsers.driver not in (None, driver), what="the new driver")
    assert first.errors == second.errors == []


def test_an_unreachable_target_is_shown_on_a_phone(control, page, open_tab):
    tab = ready(open_tab(TALL))
    control.ask(target=(0.22, -0.12, 0.63))
    tab.page.get_by_text("cm out of reach").first.wait_for()
    until(lambda: page._gap > 0.01, what="the gap")
    assert tab.errors == []


@pytest.mark.parametrize("size", [WIDE, TALL])
def test_watchers_can_stop_the_arm_by_button_and_escape_with_the_panel_folded(
    control, page, open_tab, size
):
    first = ready(open_tab())
    watcher = open_tab(size)
    watcher.page.get_by_text("Another browser drives").wait_for()
    watcher.page.get_by_text("s2c2a · twin_arm").first.click()  # folds the panel
    until(
        lambda: not watcher.page.get_by_text("Another browser drives").is_visible(),
        what="folding",
    )
    watcher.stop()
    until(lambda: control.latest.stage is Stage.HOLD, what="the watcher's stop")
    watcher.page.get_by_role("button", name="Stopped").wait_for()
    assert watcher.page.get_by_role("button", name="Resume").count() == 0
    first.page.get_by_text("Stop was pressed").wait_for()
    first.page.get_by_role("button", name="Resume").click()
    until(lambda: control.latest.stage is Stage.RUN, what="running again")
    watcher.page.keyboard.press("Escape")
    until(lambda: control.latest.stage is Stage.HOLD, what="the stop by the key")
    assert first.errors == watcher.errors == []


def test_keys_move_the_target_and_not_the_camera(control, page, open_tab):
    tab = ready(open_tab())
    camera = next(iter(page.server.get_clients().values())).camera
    before = np.array(camera.position)
    start = np.array(control.request.target)
    tab.page.keyboard.down("ArrowRight")
    until(lambda: target_beside(control, start) > 0.05, what="the target's motion")
    tab.page.keyboard.up("ArrowRight")
    until(lambda: page._steering.direction() is None, what="its end")
    tab.page.keyboard.down("f")
    until(lambda: control.request.target[2] < start[2] - 0.03, what="descent")
    tab.page.keyboard.up("f")
    assert np.allclose(camera.position, before), "the keys turned the camera"
    until(lambda: page._steering.direction() is None, what="its end")
    tab.page.get_by_label("Target [cm]").or_(tab.page.locator("input")).first.focus()
    held = control.request.target
    tab.page.keyboard.press("ArrowUp")
    assert control.request.target == held, "the keys of a field moved the target"
    assert tab.errors == []


def target_beside(control, start):
    """How far the target is to the right on the screen [m]."""
    return np.subtract(control.request.target, start) @ across_the_screen(control.arm)
