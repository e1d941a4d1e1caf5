"""Viewer of runs, recordings, trainings and arms."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.episodes import save_episodes
from s2c2a.errors import S2C2AError
from s2c2a.live.cli.view import open_window
from s2c2a.live.viewing import view_arm, view_recording, view_runs, view_training
from s2c2a.strategies import shipped_networks
from s2c2a.viz import Trace

from live_tabs import TALL, Tab, drawn_tip, until  # type: ignore[import-not-found]


@pytest.fixture
def shown(chromium):
    """A function that opens a page in a tab; both are closed afterwards."""
    pages = []

    def show(page, size=(1280, 800)):
        tab = Tab(chromium, page.gate.address, size)
        pages.append((page, tab))
        return tab

    yield show
    for page, tab in pages:
        tab.page.close()
        page.close()


def run(drawn, label: str, turn: float) -> Trace:
    """A run of an arm that bends more and more to one side."""
    offsets = 0.2 * np.linspace(0, 1, 50)
    states = np.zeros((50, 3, 6))
    states[..., 2] = 0.2 * np.arange(1, 4)
    states[..., 5] = 1.0
    states[..., 0] = np.outer(offsets * np.cos(turn), np.arange(1, 4) ** 2 / 9)
    states[..., 1] = np.outer(offsets * np.sin(turn), np.arange(1, 4) ** 2 / 9)
    desired = np.full((50, 3, 3), np.nan)
    desired[:, -1] = states[:, -1, :3] + 0.02
    return drawn(label, 0.1 * np.arange(50), states, desired_positions=desired)


@pytest.mark.slow
def test_two_runs_play_with_one_as_the_ghost_of_the_other(twin, shown, drawn):
    page = view_runs([run(drawn, "best", 0.0), run(drawn, "paper", 1.5)], twin, 0)
    tab = shown(page)
    tab.page.get_by_text("cm from the target").wait_for()
    until(lambda: drawn_tip(page.scene)[0] > 0.1, what="the run's end")
    until(lambda: page.scene._ghost.visible, what="the ghost")
    tab.page.get_by_role("button", name="Pause").click()
    assert tab.errors == []


@pytest.mark.slow
def test_sliders_bend_an_arm(twin, shown):
    page = view_arm(twin, 0)
    tab = shown(page)
    thumb = tab.page.get_by_role("slider").first
    thumb.wait_for()
    thumb.focus()
    for _ in range(30):
        tab.page.keyboard.press("ArrowRight")
    until(lambda: drawn_tip(page.scene)[0] > 0.05, what="bending")
    assert tab.errors == []


@pytest.mark.slow
def test_a_recording_shows_its_workspace_and_coverage_on_a_phone(recording, shown):
    tab = shown(view_recording(recording.episodes, 0), TALL)
    tab.page.get_by_role("button", name="Pause").wait_for()
    tab.page.get_by_text("Coverage").wait_for()
    image = tab.page.locator("img[src^='blob:']")
    until(lambda: image.count() == 1, what="the image")
    assert tab.errors == []


def test_runs_and_recordings_are_distinguished(recording, twin, tmp_path):
    (tmp_path / "a").mkdir()
    save_episodes(recording.episodes[:2], tmp_path / "a" / "runs.episodes")
    save_episodes(
        recording.episodes[:2], tmp_path / "collected.episodes", recording.options
    )
    for path, label in (
        (tmp_path / "a", "Run"),
        (tmp_path / "collected.episodes", "Episode"),
    ):
        window = open_window((str(path),), 0)
        try:
            elements = window.server.gui._gui_input_handle_from_uuid.values()
            assert label in {element.label for element in elements}
            assert window.arm == twin
        finally:
            window.close()


def test_inputs_that_cannot_be_viewed_raise(tmp_path):
    (tmp_path / "mine.csv").write_text("time,x,y,z\n0,0,0,0.5\n")
    for paths, words in (
        ((), "say what to look at"),
        ((str(tmp_path),), "no runs in"),
        (("twin_arm", "simulated_arm"), "not all are runs"),
        (("no_such_arm",), "give a preset, an arm file, a run directory"),
        ((str(tmp_path / "mine.csv"),), "give a preset, an arm file, a run directory"),
        (("runs/nothing",), "give a preset, an arm file, a run directory"),
        (("none.episodes",), "none.episodes"),
    ):
        with pytest.raises(S2C2AError, match=words):
            open_window(paths, 0)


@pytest.mark.slow
def test_a_training_shows_the_curves_of_both_networks_and_of_the_vibration(twin, shown):
    networks = shipped_networks(twin)
    assert set(networks.trained) == {"C2S", "C2A", "modal_model"}
    tab = shown(view_training(networks, 0))
    tab.page.get_by_text("of the full range").first.wait_for()
    until(lambda: tab.page.locator(".uplot").count() == 3, what="three charts")
    assert tab.errors == []


@pytest.mark.slow
def test_a_training_shows_its_errors_on_unseen_motion(tiny_best_networks, shown):
    trained = dict(tiny_best_networks.trained)
    errors = {"validation samples": 0.003}
    trained["C2S"] = replace(trained["C2S"], errors=errors)
    tab = shown(view_training(replace(tiny_best_networks, trained=trained), 0))
    text = "C2S at the tip: 3.0 mm (mean) on validation samples"
    tab.page.get_by_text(text).wait_for()
    tab.page.get_by_text("modal model:").wait_for()
    assert tab.errors == []


@pytest.mark.slow
def test_drags_on_a_hanging_arm_are_in_the_base_frame(make_arm, shown):
    arm = make_arm(gravity_direction=(0.0, 0.0, 1.0))
    page = view_arm(arm, 0)
    positions = []
    page.scene.on_drag(
        lambda _client, position: positions.append(position),
        *[lambda *_: None] * 3,
    )
    page.scene.draw_target((0.0, 0.1, 0.5), None, 0.0)
    tab = shown(page)
    tab.page.get_by_text("gravity").wait_for()
    start = np.array(tab.place_of((0.0, 0.1, 0.5), arm))
    end = start + np.array([60.0, -40.0])
    tab.drag(start, end)
    until(
        lambda: positions and np.allclose(tab.place_of(positions[-1], arm), end, 0, 6),
        what="the drag",
    )
    assert positions[-1][2] < 0.5  # upwards on the screen is towards the base
    places = [tab.place_of((0.0, 0.0, height), arm) for height in (0.0, 0.6)]
    assert places[1][1] > places[0][1] + 200
    red, _, blue = np.moveaxis(np.array(tab.screenshot(), dtype=int), -1, 0)
    column = round(places[0][0])
    base_row = round(places[0][1])
    tip_row = round(places[1][1])
    near = slice(column - 20, column + 20)
    assert (blue - red)[base_row + 30 : base_row + 80, near].mean() > 40
    assert (red - blue)[tip_row - 80 : tip_row - 30, near].mean() > 40
    assert tab.errors == []


@pytest.mark.slow
def test_gravity_of_a_lying_arm_is_shown(make_arm, shown):
    tab = shown(view_arm(make_arm(gravity_direction=(1.0, 0.0, 0.0)), 0))
    tab.page.get_by_text("gravity").wait_for()
    assert tab.errors == []
