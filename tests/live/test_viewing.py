"""What is finished, in the same scene."""

import time

import numpy as np
import pytest

from s2c2a.cli.view import window_on
from s2c2a.episodes import save_episodes
from s2c2a.errors import S2C2AError
from s2c2a.live.viewing import view_arm, view_recording, view_runs, view_training
from s2c2a.strategies import shipped_networks
from s2c2a.viz import Trace

from live_tabs import TALL, Tab, drawn_tip, until  # type: ignore[import-not-found]


@pytest.fixture
def shown(chromium):
    """Opens a page in a tab, and closes both."""
    opened = []

    def show(page, size=(1280, 800)):
        tab = Tab(chromium, page.gate.address, size)
        opened.append((page, tab))
        return tab

    yield show
    for page, tab in opened:
        tab.page.close()
        page.close()


def run(drawn, label: str, turn: float) -> Trace:
    """An arm that leans further and further to one side."""
    leans = 0.2 * np.linspace(0, 1, 50)
    states = np.zeros((50, 3, 6))
    states[..., 2], states[..., 5] = 0.2 * np.arange(1, 4), 1.0
    states[..., 0] = np.outer(leans * np.cos(turn), np.arange(1, 4) ** 2 / 9)
    states[..., 1] = np.outer(leans * np.sin(turn), np.arange(1, 4) ** 2 / 9)
    desired = np.full((50, 3, 3), np.nan)
    desired[:, -1] = states[:, -1, :3] + 0.02
    return drawn(label, 0.1 * np.arange(50), states, desired_positions=desired)


def test_two_runs_are_played_one_as_the_ghost_of_the_other(twin, shown, drawn):
    page = view_runs([run(drawn, "best", 0.0), run(drawn, "paper", 1.5)], twin, 0)
    tab = shown(page)
    tab.page.get_by_text("cm from the target").wait_for()
    until(lambda: drawn_tip(page.scene)[0] > 0.1, what="the run's end")
    until(lambda: page.scene._ghost.visible, what="the ghost")
    tab.page.get_by_role("button", name="Pause").click()
    tab.keep("wide-runs")
    assert tab.errors == []


def test_an_arm_is_bent_by_sliders(twin, shown):
    page = view_arm(twin, 0)
    tab = shown(page)
    thumb = tab.page.get_by_role("slider").first
    thumb.wait_for()
    thumb.focus()
    for _ in range(30):
        tab.page.keyboard.press("ArrowRight")
    until(lambda: drawn_tip(page.scene)[0] > 0.05, what="bending")
    tab.keep("wide-arm")
    assert tab.errors == []


def test_a_recording_shows_its_workspace_on_a_telephone_too(recording, shown):
    tab = shown(view_recording(recording.episodes, 0), TALL)
    tab.page.get_by_role("button", name="Pause").wait_for()
    time.sleep(2.0)
    tab.keep("tall-recording")
    assert tab.errors == []


def test_a_file_of_runs_is_told_from_a_recording(recording, twin, tmp_path):
    (tmp_path / "a").mkdir()
    save_episodes(recording.episodes[:2], tmp_path / "a" / "runs.episodes")
    save_episodes(
        recording.episodes[:2], tmp_path / "collected.episodes", recording.options
    )
    for what, label in (
        (tmp_path / "a", "Run"),
        (tmp_path / "collected.episodes", "Show"),
    ):
        window = window_on((str(what),), 0)
        try:
            assert label in {
                one.label
                for one in window.server.gui._gui_input_handle_from_uuid.values()
            }
            assert window.arm == twin
        finally:
            window.close()


def test_what_cannot_be_viewed_is_said(tmp_path):
    for nothing in (
        (),
        (str(tmp_path),),
        ("twin_arm", "simulated_arm"),
        ("no_such_arm",),
        ("none.episodes",),
    ):
        with pytest.raises(S2C2AError):
            window_on(nothing, 0)


def test_a_training_shows_the_curves_of_both_networks_and_of_the_swing(twin, shown):
    networks = shipped_networks(twin)
    assert set(networks.curves) == {"C2S", "C2A", "swing"}
    tab = shown(view_training(networks, 0))
    tab.page.get_by_text("of the full range").first.wait_for()
    until(lambda: tab.page.locator(".uplot").count() == 3, what="three charts")
    tab.keep("wide-training")
    assert tab.errors == []


def test_a_hanging_arm_hangs_and_what_is_dragged_is_told_in_its_base_frame(
    make_arm, shown
):
    arm = make_arm(gravity_direction=(0.0, 0.0, 1.0))
    page, told = view_arm(arm, 0), []
    page.scene.on_drag(
        lambda _who, where: told.append(where), lambda *_: None, lambda *_: None
    )
    page.scene.draw_target((0.0, 0.1, 0.5), None, 0.0)
    tab = shown(page)
    tab.page.get_by_text("gravity").wait_for()
    until(lambda: tab.drag_told((0.0, 0.1, 0.5), (60, -40), arm, told), what="the drag")
    x, y = tab.place_of((0.0, 0.1, 0.5), arm)
    np.testing.assert_allclose(tab.place_of(told[-1], arm), (x + 60, y - 40), atol=6)
    assert told[-1][2] < 0.5  # up the screen is towards the base
    places = [tab.place_of((0.0, 0.0, height), arm) for height in (0.0, 0.6)]
    assert places[1][1] > places[0][1] + 200
    red, _, blue = np.moveaxis(np.array(tab.seen(), dtype=int), -1, 0)
    column, rows = round(places[0][0]), [round(places[k][1]) for k in (0, 1)]
    near = slice(column - 20, column + 20)
    assert (blue - red)[rows[0] + 30 : rows[0] + 80, near].mean() > 40
    assert (red - blue)[rows[1] - 80 : rows[1] - 30, near].mean() > 40
    tab.keep("wide-hanging")
    assert tab.errors == []


def test_gravity_is_shown_where_the_arm_does_not_stand_upright(make_arm, shown):
    hanging, lying = (
        make_arm(gravity_direction=direction)
        for direction in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    )
    for arm in (hanging, lying):
        tab = shown(view_arm(arm, 0))
        tab.page.get_by_text("gravity").wait_for()
        tab.keep(f"wide-gravity-{arm.gravity_direction[0]:g}")
        assert tab.errors == []
