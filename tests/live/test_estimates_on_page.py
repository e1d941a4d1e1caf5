"""Estimates on the page, if the strategy has an estimator."""

import re
from dataclasses import replace
from functools import partial

import pytest

from s2c2a.arm import load_arm
from s2c2a.live.control import ArmControl
from s2c2a.live.page import LivePage
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import s2c2a_strategy, shipped_networks
from s2c2a.tasks import load_task

from live_tabs import Tab, until  # type: ignore[import-not-found]


@pytest.fixture(scope="module")
def sensing_arm():
    """The twin with a sensor of its bends."""
    twin = load_arm("twin_arm")
    return type(twin).model_validate(twin.model_dump() | {"sensors": {"bends": True}})


@pytest.fixture
def estimating(sensing_arm, tmp_path):
    """Control and page of `sensing_arm` with a payload of 50 g."""
    networks = replace(shipped_networks(load_arm("twin_arm")), arm=sensing_arm)
    tasks = {"circle": partial(load_task, "circle", sensing_arm)}
    control = ArmControl(
        SimulatedRobot(sensing_arm, payload=0.05),
        {"s2c2a": lambda: s2c2a_strategy(networks)},
        tasks,
        release_after=9.0,
    )
    control.start()
    page = LivePage(control, 0, tmp_path)
    yield control, page
    page.close()
    control.stop()


@pytest.mark.slow
def test_the_page_shows_the_estimated_payload(estimating, chromium):
    control, page = estimating
    tab = Tab(chromium, page.gate.address)
    tab.page.get_by_text("Drag the violet ball").wait_for()
    control.ask(task="circle", playing=True, payload=0.05)

    def payload_on_page() -> float:
        """The payload in the status line [g]."""
        match = re.search(r"(\d+) g\b", page._status.content)
        return float(match[1]) if match else 0.0

    until(lambda: 30 < payload_on_page() < 70, what="the estimated payload")
    tab.page.get_by_text(re.compile(r"\d+ g\b")).first.wait_for()
    assert tab.errors == []
    tab.page.close()
