"""Executors: the same results on each, and reported failures."""

import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

from s2c2a.errors import S2C2AError, SimulationError
from s2c2a.execution.executors import (
    Processes,
    Serial,
    Threads,
    all_cores,
    in_order,
    max_pending_calls,
)
from waiting import until

linux = pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="needs /proc")
EXECUTORS = {
    "serial": Serial,
    "threads": partial(Threads, 3),
    "processes": partial(Processes, 2),
    "of the standard library": partial(ThreadPoolExecutor, 2),
}


def square(number: int) -> int:
    time.sleep(0.01 * (number % 3))
    return number * number


def failing_at(bad: int, number: int) -> int:
    if number == bad:
        raise SimulationError("blew up", step=3)
    return number


def killed_at(bad: int, number: int) -> int:
    if number == bad:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.fixture(params=EXECUTORS, scope="module")
def executor(request):
    with EXECUTORS[request.param]() as made:
        yield made


def test_results_keep_the_order_of_the_arguments(executor):
    assert list(in_order(executor, square, range(7))) == [0, 1, 4, 9, 16, 25, 36]
    assert list(in_order(executor, square, [])) == []


def test_exceptions_of_the_work_are_raised_unchanged(executor):
    with pytest.raises(SimulationError, match="blew up") as caught:
        list(in_order(executor, partial(failing_at, 2), range(20)))
    assert caught.value.step == 3


def test_the_number_of_pending_calls_is_limited():
    taken = []
    with Threads(2) as executor:
        numbers = (taken.append(number) or number for number in range(100))
        results = in_order(executor, square, numbers)
        next(results)
        assert len(taken) <= max_pending_calls(executor) == 4
        results.close()


def test_serial_execution_starts_one_call_at_a_time():
    begun = []
    next(in_order(Serial(), begun.append, range(3)))
    assert begun == [0]


def test_a_killed_process_is_reported():
    told = r"one of 1 processes was killed.*fewer --jobs"
    with pytest.raises(S2C2AError, match=told), Processes(1) as executor:
        list(in_order(executor, partial(killed_at, 2), range(5)))


@pytest.mark.parametrize("kind", [Threads, Processes])
def test_fewer_than_one_worker_is_rejected(kind):
    with pytest.raises(S2C2AError, match="0 workers"):
        kind(0)


def test_all_cores_are_taken_unless_stated():
    assert 1 <= all_cores() <= (os.cpu_count() or 1)
    assert Threads().workers == all_cores()
    assert 1 <= Processes().workers <= all_cores()


def test_a_simulation_error_can_be_pickled():
    error = pickle.loads(pickle.dumps(SimulationError("blew up", 7, [1.0])))
    assert (str(error), error.step, error.last_states) == ("blew up", 7, [1.0])


THREADS = """
import os
from s2c2a.execution.executors import limit_jax_to_one_thread
limit_jax_to_one_thread()
import jax.numpy as jnp
jnp.ones(3).sum().block_until_ready()
folder = "/proc/self/task"
names = [open(f"{folder}/{task}/comm").read() for task in os.listdir(folder)]
print(len([name for name in names if "XLAEigen" in name]))
"""


@linux
def test_a_process_of_ours_computes_on_one_thread():
    """The summation order of XLA depends on its threads; a seed's networks must not."""
    assert int(subprocess.check_output([sys.executable, "-c", THREADS])) == 1


ORPHANS = """
import os, time
from s2c2a.execution.executors import Processes
if __name__ == "__main__":
    with Processes(1) as one:
        print(one.submit(os.getpid).result(), flush=True)
        time.sleep(60)
"""


@linux
def test_workers_end_with_a_killed_parent(tmp_path):
    (tmp_path / "orphans.py").write_text(ORPHANS)
    command = [sys.executable, tmp_path / "orphans.py"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as killed:
        worker = int(killed.stdout.readline())
        killed.kill()

    def has_ended():
        try:
            state = (
                Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[0]
            )
        except OSError:
            return True
        return state == "Z"  # a zombie: its exit code has not been read

    until(has_ended, 10.0)
