"""Estimates and stability margins on the page, if the strategy has an estimator."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.evaluation import belief_said
from s2c2a.live.control import ArmControl
from s2c2a.live.page import LivePage
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import s2c2a_strategy, shipped_networks
from s2c2a.tasks import task_named

from live_tabs import Tab, until  # type: ignore[import-not-found]


def test_the_estimate_names_payload_bend_bias_force_and_rejected_sensors():
    diagnostics = {
        "load": np.array(0.048),
        "bend_biases": np.deg2rad([[0.3, 0.4], [1.2, 0.0]]),
        "push": np.array(0.31),
        "rejected.imu": np.array(0.0),
    }
    text = belief_said(diagnostics)
    assert "48 g" in text
    assert "1.2 deg" in text
    assert "0.3 N" in text
    assert "imu" not in text
    assert "imu" in belief_said(diagnostics | {"rejected.imu": np.array(1.0)})


def test_there_is_no_estimate_without_sensors():
    diagnostics = {"load": np.array(0.0), "bend_biases": np.zeros((3, 2))}
    assert belief_said(diagnostics) == ""
    assert belief_said({}) == ""


@pytest.fixture(scope="module")
def sensing_arm():
    """The twin with a sensor of its bends."""
    twin = load_arm("twin_arm")
    return type(twin).model_validate(twin.model_dump() | {"sensors": {"bends": True}})


@pytest.fixture
def estimating(sensing_arm, tmp_path):
    """Control and page of `sensing_arm` with a payload of 50 g."""
    networks = replace(shipped_networks(load_arm("twin_arm")), arm=sensing_arm)
    tasks = {"circle": partial(task_named, "circle", sensing_arm)}
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


def test_the_page_shows_the_estimated_payload_and_the_margins(estimating, chromium):
    control, page = estimating
    tab = Tab(chromium, page.gate.address)
    tab.page.get_by_text("Drag the violet ball").wait_for()
    control.ask(task="circle", playing=True, payload=0.05)
    until(lambda: " g · " in page._status.content, what="a payload on the page")
    until(
        lambda: 0.03 < float(control.latest.step.diagnostics.get("load", 0.0)) < 0.07,
        what="the estimated payload",
    )
    tab.page.get_by_text(" g · ").first.wait_for()
    tab.page.get_by_role("tab", name="More").click()
    tab.page.get_by_text("Stability margins: ").wait_for()
    tab.keep("wide-estimates")
    assert tab.errors == []
    tab.page.close()


def test_an_arm_without_sensors_has_neither_margins_nor_rejections(control):
    assert control.latest.margins == ""
    diagnostics = control.latest.step.diagnostics
    assert not any(name.startswith("rejected.") for name in diagnostics)
