"""Heartbeats between page and control when one of them hangs or is killed."""

import http.client
import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.live.gate import STOP, STOP_HEADER
from s2c2a.live.page import STOP_PRESSED, LivePage
from s2c2a.live.process import ENDED, NOT_RESPONDING, PAGE_LOST, ControlProcess
from s2c2a.spaces import Stage

from light_control import light_control  # type: ignore[import-not-found]
from live_tabs import until  # type: ignore[import-not-found]

TIMEOUT = 2.0  # s
PAGE_THAT_HANGS = """
import sys
sys.path.insert(0, sys.argv[1])
from light_control import light_control
from s2c2a.arm import load_arm
from s2c2a.live.process import ControlProcess

if __name__ == "__main__":
    control = ControlProcess(load_arm("twin_arm"), light_control)
    control.wait_until_ready()
    def report(snapshot):
        values = snapshot.step.moment, snapshot.stage.name, control.halted_by
        print(*values, sep="|", flush=True)

    control.watch(report)
    control.ask(driven=True, target=(0.15, 0.0, 0.55))
    sys.stdin.readline()
    control.ask(target=(0.0, 0.15, 0.55))  # dragged meanwhile
    sys.stdin.readline()
    control.ask(stopped=False)
    sys.stdin.readline()
    control.stop()
"""


@pytest.fixture(scope="module")
def live(twin, tmp_path_factory):
    """A running control process and its page; a test that kills it is the last."""
    running = ControlProcess(twin, light_control)
    page = LivePage(running, 0, tmp_path_factory.mktemp("live"))
    running.wait_until_ready()
    running.ask(driven=True, target=(0.15, 0.0, 0.55))
    until(lambda: running.latest.stage is Stage.RUN, what="running")
    yield running, page
    page.close()
    running.stop()


def until_shown(page, text: str, **seconds: float) -> None:
    until(lambda: text in page._status.content, what=text, **seconds)


def press_stop(page) -> int:
    """Status code of the request that the Stop button sends."""
    connection = http.client.HTTPConnection("127.0.0.1", page.gate.port, timeout=10)
    connection.request("GET", STOP, headers={STOP_HEADER: "1"})
    return connection.getresponse().status


@pytest.mark.slow
def test_a_control_that_hangs_is_reported_and_obeys_a_stop_afterwards(live):
    control, page = live
    os.kill(control.process, signal.SIGSTOP)
    until_shown(page, NOT_RESPONDING, seconds=TIMEOUT + 0.3)
    assert press_stop(page) == 503
    with pytest.raises(S2C2AError, match=NOT_RESPONDING):
        control.reset()
    os.kill(control.process, signal.SIGCONT)
    until(lambda: control.latest.stage is Stage.HOLD, what="the stop")
    until_shown(page, STOP_PRESSED)
    control.ask(stopped=False)
    until(lambda: control.latest.stage is Stage.RUN, what="running again")


@pytest.mark.slow
def test_a_killed_control_is_reported_and_cannot_be_reset(live):
    control, page = live
    os.kill(control.process, signal.SIGKILL)
    until_shown(page, ENDED)
    assert press_stop(page) == 503
    assert "has ended" in control.latest.fault
    control.ask(driven=True)
    for call in (control.reset, control.reset, partial(control.use, "pcc")):
        with pytest.raises(S2C2AError, match="has ended"):
            call()


@pytest.mark.slow
def test_a_page_that_hangs_stops_its_arm_until_the_driver_resumes():
    page = subprocess.Popen(
        [sys.executable, "-c", PAGE_THAT_HANGS, os.path.dirname(__file__)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    rows = iter(page.stdout.readline, "")

    def report() -> tuple[float, str, str]:
        moment, stage, reason = next(rows).split("|")
        return float(moment), stage, reason.strip()

    def advance() -> None:
        page.stdin.write("\n")
        page.stdin.flush()

    while report()[1] != "RUN":
        pass
    stopped = time.perf_counter()
    page.send_signal(signal.SIGSTOP)
    time.sleep(2.5)
    page.send_signal(signal.SIGCONT)
    advance()  # a target dragged meanwhile does not resume the arm
    reports = [report()]
    while reports[-1][0] < stopped + 3.5:
        reports.append(report())
    holding = [moment for moment, stage, _ in reports if stage == "HOLD"]
    assert holding[0] - stopped < TIMEOUT
    assert all(stage == "HOLD" for moment, stage, _ in reports if moment > holding[0])
    assert reports[-1][2] == PAGE_LOST
    advance()
    while report()[1] != "RUN":
        pass
    page.communicate("\n", timeout=30)
    assert page.returncode == 0
