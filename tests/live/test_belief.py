"""What is known of the arm is said while it works, where the strategy observes, and nothing of it elsewhere."""

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


def test_load_the_largest_lean_and_what_is_left_out_are_said_in_their_units():
    told = {
        "load": np.array(0.048),
        "bend_biases": np.deg2rad([[0.3, 0.4], [1.2, 0.0]]),
        "rejected.imu": np.array(0.0),
    }
    told["push"] = np.array(0.31)
    assert (
        belief_said(told) == "at the tip: 48 g · leans: 1.2 deg, as if pushed by 0.3 N"
    )
    assert belief_said(told | {"rejected.imu": np.array(1.0)}).endswith(
        "**not believed: imu**"
    )


def test_nothing_is_said_where_nothing_is_sensed():
    assert (
        belief_said({"load": np.array(0.0), "bend_biases": np.zeros((3, 2))})
        == belief_said({})
        == ""
    )


@pytest.fixture(scope="module")
def watched():
    """The twin, with something that sees its bends."""
    twin = load_arm("twin_arm")
    return type(twin).model_validate(twin.model_dump() | {"sensors": {"bends": True}})


@pytest.fixture
def watching(watched, tmp_path):
    """Its control and page, 50 g at the tip."""
    networks = replace(shipped_networks(load_arm("twin_arm")), arm=watched)
    tasks = {"circle": partial(task_named, "circle", watched)}
    control = ArmControl(
        SimulatedRobot(watched, payload=0.05),
        {"s2c2a": lambda: s2c2a_strategy(networks)},
        tasks,
        release_after=9.0,
    )
    control.start()
    page = LivePage(control, 0, tmp_path)
    yield control, page
    page.close()
    control.stop()


def test_the_page_says_what_hangs_there_and_the_panel_the_margins(watching, chromium):
    control, page = watching
    tab = Tab(chromium, page.gate.address)
    tab.page.get_by_text("Drag the violet ball").wait_for()
    control.ask(task="circle", playing=True, payload=0.05)
    until(lambda: "at the tip: " in page._status.content, what="a word of the load")
    until(
        lambda: 0.03 < float(control.latest.step.diagnostics.get("load", 0.0)) < 0.07,
        what="finding the load",
    )
    tab.page.get_by_text("bend_biases").first.wait_for()
    tab.page.get_by_role("tab", name="More").click()
    tab.page.get_by_text("Margins of the loop: it may answer").wait_for()
    tab.keep("wide-belief")
    assert tab.errors == []
    tab.page.close()


def test_an_arm_that_senses_nothing_has_no_margins(control):
    assert control.latest.margins == ""
    assert not any(
        name.startswith("rejected.") for name in control.latest.step.diagnostics
    )
