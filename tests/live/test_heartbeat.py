"""Page and control know of each other's life, whichever of them hangs or is killed."""

import http.client
import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.live.control import arm_control
from s2c2a.live.gate import STOP, STOP_HEADER
from s2c2a.live.page import LivePage
from s2c2a.live.process import ENDED, MISSED, SILENT, ControlProcess
from s2c2a.robots import Body
from s2c2a.spaces import Stage

from live_tabs import until  # type: ignore[import-not-found]

SOON = 2.0  # s
PAGE_THAT_HANGS = """
import sys, time
from functools import partial
from s2c2a.arm import load_arm
from s2c2a.live.control import arm_control
from s2c2a.live.process import ControlProcess
from s2c2a.robots import Body

if __name__ == "__main__":
    arm = load_arm("twin_arm")
    control = ControlProcess(arm, partial(arm_control, arm, Body(), release_after=60.0))
    control.wait_until_ready()
    say = lambda one: print(one.step.moment, one.stage.name, control.halted_by, sep="|", flush=True)
    control.watch(say)
    control.ask(driven=True, target=(0.15, 0.0, 0.55))
    sys.stdin.readline()
    control.ask(target=(0.0, 0.15, 0.55))  # what was dragged meanwhile
    sys.stdin.readline()
    control.ask(stopped=False)
    sys.stdin.readline()
    control.stop()
"""


@pytest.fixture
def live(twin, tmp_path):
    """A control process that drives, and its page."""
    running = ControlProcess(
        twin, partial(arm_control, twin, Body(), release_after=60.0)
    )
    page = LivePage(running, 0, tmp_path)
    running.wait_until_ready()
    running.ask(driven=True, target=(0.15, 0.0, 0.55))
    until(lambda: running.latest.stage is Stage.RUN, what="running")
    yield running, page
    page.close()
    running.stop()


def said_within(page, text: str, seconds: float = SOON) -> None:
    until(lambda: text in page._status.content, seconds, text)


def stop_said_to(page) -> int:
    asked = http.client.HTTPConnection("127.0.0.1", page.gate.port, timeout=10)
    asked.request("GET", STOP, headers={STOP_HEADER: "1"})
    return asked.getresponse().status


def test_a_control_that_hangs_is_told_of_and_a_stop_that_was_said_meanwhile_is_heard_when_it_goes_on(
    live,
):
    control, page = live
    os.kill(control.process, signal.SIGSTOP)
    said_within(page, MISSED, SOON + 0.3)
    assert stop_said_to(page) == 503
    with pytest.raises(S2C2AError, match=MISSED):
        control.reset()
    os.kill(control.process, signal.SIGCONT)
    until(lambda: control.latest.stage is Stage.HOLD, what="the stop")
    said_within(page, "looks at this page")
    control.ask(stopped=False)
    until(lambda: control.latest.stage is Stage.RUN, what="going on")


def test_a_control_that_is_killed_is_told_of_and_so_is_whoever_resets(live):
    control, page = live
    os.kill(control.process, signal.SIGKILL)
    said_within(page, ENDED)
    assert stop_said_to(page) == 503
    with pytest.raises(S2C2AError, match="has ended"):
        control.reset()


def test_a_page_that_hangs_stops_its_arm_which_goes_on_only_when_somebody_says_so():
    page = subprocess.Popen(
        [sys.executable, "-c", PAGE_THAT_HANGS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    rows = iter(page.stdout.readline, "")
    told = lambda: (lambda moment, stage, by: (float(moment), stage, by.strip()))(
        *next(rows).split("|")
    )

    def order() -> None:
        page.stdin.write("\n")
        page.stdin.flush()

    while told()[1] != "RUN":
        pass
    stopped = time.perf_counter()
    page.send_signal(signal.SIGSTOP)
    time.sleep(3.0)
    page.send_signal(signal.SIGCONT)
    order()  # a target that was dragged in between does not let it go on
    seen = [told()]
    while seen[-1][0] < stopped + 5.0:
        seen.append(told())
    held = [moment for moment, stage, _ in seen if stage == "HOLD"]
    assert held[0] - stopped < SOON
    assert all(stage == "HOLD" for moment, stage, _ in seen if moment > held[0])
    assert seen[-1][2] == SILENT
    order()
    while told()[1] != "RUN":
        pass
    page.communicate("\n", timeout=30)
    assert page.returncode == 0
