"""Fixtures: a live page of the twin with the shipped networks, and browser tabs."""

from functools import partial

import pytest

from s2c2a.arm import load_arm
from s2c2a.live.control import ArmControl
from s2c2a.live.page import LivePage
from s2c2a.live.workspace import survey
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import WallClock
from s2c2a.tasks import TASKS, load_task

from light_control import light_strategy  # type: ignore[import-not-found]
from live_tabs import CHROMIUM, FLAGS, WIDE, Tab


@pytest.fixture(scope="session")
def strategy():
    """A strategy for the twin that compiles quickly."""
    return light_strategy(load_arm("twin_arm"))


@pytest.fixture
def clock():
    """The clock of the control."""
    return WallClock()


@pytest.fixture
def control(twin, strategy, clock):
    """A running control of the simulated twin."""
    tasks = {name: partial(load_task, name, twin) for name in TASKS}
    running = ArmControl(
        SimulatedRobot(twin), {"s2c2a": lambda: strategy}, tasks, 2.0, clock
    )
    running.start()
    yield running
    running.stop()


@pytest.fixture
def page(control, twin, tmp_path):
    """The page of `control`."""
    live_page = LivePage(control, 0, tmp_path / "runs", lambda: survey(twin))
    yield live_page
    live_page.close()


@pytest.fixture(scope="session")
def chromium():
    """A headless browser."""
    if CHROMIUM is None:
        pytest.skip("no chromium, chromium-browser or google-chrome on the path")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def open_tab(chromium, page):
    """A function that opens a tab on the live page."""
    tabs = []

    def open_one(size=WIDE) -> Tab:
        tab = Tab(chromium, page.gate.address, size)
        tabs.append(tab)
        return tab

    yield open_one
    for tab in tabs:
        tab.page.close()
