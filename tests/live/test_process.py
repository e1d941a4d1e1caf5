"""Control of the arm in a separate process, also when one of the processes ends."""

import os
import signal
from functools import partial

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.live.control import arm_control, tasks_of
from s2c2a.live.process import ControlProcess
from s2c2a.robots import RobotFactory
from s2c2a.spaces import POSITION, Stage
from s2c2a.tasks import TASKS

from light_control import light_control  # type: ignore[import-not-found]
from live_tabs import until  # type: ignore[import-not-found]


def start_process(arm, files=()):
    """A process with all strategies and tasks."""
    return ControlProcess(
        arm, partial(arm_control, arm, RobotFactory(), files, release_after=1.0)
    )


def until_ended(control):
    """Wait until the process has ended, without a `join` besides `_receive_all`'s."""
    until(lambda: not control._process.is_alive(), what="the end of the process")


@pytest.fixture
def control(twin):
    """A running control process."""
    running = ControlProcess(twin, light_control)
    running.wait_until_ready()
    yield running
    running.stop()


@pytest.mark.slow
def test_it_obeys_requests_changes_strategies_and_ends_at_rest(twin):
    control = start_process(twin)
    control.wait_until_ready()
    rows = []
    control.watch(rows.append)
    assert control.limits.tasks
    control.ask(driven=True, target=(0.18, 0.05, 0.54))
    until(lambda: control.latest.error < 0.01, what="arriving")
    # the request is clipped in this process, too
    assert control.ask(target=(9.0, 0.0, 0.0)).target[0] < 1.3
    with pytest.raises(
        S2C2AError, match=r"no strategy 'nobody'; choose one of s2c2a · best"
    ):
        control.use("nobody")
    control.use("pcc · best")
    until(
        lambda: (
            control.latest.strategy == "pcc · best"
            and control.latest.stage is Stage.RUN
        )
    )
    control.ask(task="circle", playing=True, speed=4.0)
    until(lambda: control.latest.task_step > 5)
    control.ask(playing=False)
    control.restart_task()
    until(lambda: control.latest.task_step == 0)
    control.step_task()
    until(lambda: control.latest.task_step == 1)
    control.reset()
    until(
        lambda: (
            control.latest.stage is Stage.RUN
            and np.linalg.norm(control.latest.states[-1, :2]) < 0.02
        )
    )
    control.ask(target=(0.1, 0.1, 0.55))
    until(lambda: control.latest.error < 0.05, what="arriving with the accuracy of pcc")
    control.stop()
    assert (
        np.linalg.norm(rows[-1].states[-1, POSITION] - (0, 0, control.arm.length))
        < 0.05
    )
    assert np.diff([row.step.number for row in rows]).max() == 1


def test_a_terminated_process_returns_its_arm_to_rest(control):
    control.ask(driven=True, target=(0.2, 0.0, 0.5))
    until(lambda: control.latest.states[-1, 0] > 0.1, what="bending")
    os.kill(control.process, signal.SIGTERM)
    until_ended(control)
    until(lambda: control.latest.stage is Stage.FAULT)
    assert (
        np.linalg.norm(control.latest.states[-1, POSITION] - (0, 0, control.arm.length))
        < 0.05
    )


def test_only_tasks_that_fit_the_arm_are_offered(twin, make_arm):
    assert tuple(tasks_of(twin)) == tuple(TASKS)
    few = tasks_of(make_arm(1))
    assert "hold-middle" not in few
    assert len(few) == len(list(few)) < len(TASKS)
    with pytest.raises(KeyError):
        few["hold-middle"]


@pytest.mark.slow
def test_it_ends_when_the_pipe_closes(control):
    control._pipe.close()
    until_ended(control)


def test_a_strategy_that_cannot_be_built_is_reported(twin):
    control = start_process(twin, files=("nowhere.safetensors",))
    with pytest.raises(S2C2AError, match=r"no strategy at nowhere.safetensors"):
        control.wait_until_ready()
    control.stop()


def test_a_process_that_dies_while_it_prepares_ends_the_wait(twin):
    control = ControlProcess(twin, partial(os._exit, 1))
    with pytest.raises(S2C2AError, match="the control process has ended"):
        control.wait_until_ready()
    control.stop()
