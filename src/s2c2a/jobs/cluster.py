"""Workers on other machines: those of a dask scheduler (extra `cluster`)."""

import logging
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

from distributed import Client, KilledWorker, LocalCluster
from distributed.cfexecutor import ClientExecutor
from distributed.versions import get_versions

from s2c2a.errors import ClusterError
from s2c2a.executors import checked_count, compute_on_one_thread, processes_that_fit
from s2c2a.versions import PACKAGES

LOCAL = "local"
PROTOCOLS = ("tcp://", "tls://")
COUNTED = ("s2c2a", *PACKAGES, "distributed")
PATIENCE = 15  # s for a scheduler to answer


class Cluster(ClientExecutor):
    """The workers of a scheduler; those that join later help, what those that are lost had begun is done again.

    It is dask's own executor, which heeds versions and says in words what went wrong;
    leave it, and its client goes.

    Args:
        address: of the scheduler, such as tcp://host:8786; the file in which it wrote
            it (.json); or "local", for a scheduler and workers on this machine.
        count: workers of "local"; one for every core if None.

    Raises:
        ClusterError: no such address, nobody answers there, or workers have other
            versions than this process.
    """

    def __init__(self, address: str, count: int | None = None):
        self._address = address
        self._versions = _own_versions()
        with ExitStack() as held:
            client = _client(
                address,
                held.enter_context(_local_cluster(count)) if address == LOCAL else None,
            )
            held.callback(client.close)
            _check_versions(client, address)
            self._held = held.pop_all()
        super().__init__(client, pure=False)

    def submit(self, fn, *args, **kwargs) -> Future:  # type: ignore[override] # as dask's own does
        """Have a worker do it.

        Raises:
            ClusterError: the scheduler is gone.
        """
        try:
            return super().submit(_done_there, self._versions, fn, *args, **kwargs)
        except OSError as error:
            raise self._gone() from error

    @property
    def workers(self) -> int:
        """How many calls can be done at a time; workers come and go.

        Raises:
            ClusterError: the scheduler is gone.
        """
        try:
            return max(1, sum(self._client.nthreads().values()))
        except OSError as error:
            raise self._gone() from error

    def __exit__(self, kind, error, trace):
        """Let go of what is not done, and of workers of our own.

        Raises:
            ClusterError: the scheduler is gone, or what was to be done kills whoever
                takes it.
        """
        self._held.close()
        if isinstance(error, CancelledError):
            raise self._gone() from error
        if isinstance(error, KilledWorker):
            raise ClusterError(
                f"several workers at {self._address} were killed by one job, perhaps for want of memory; give each "
                "more (docs/cluster.md), then say the same again: what was whole is kept"
            ) from error

    def _gone(self) -> ClusterError:
        return ClusterError(
            f"the scheduler at {self._address} is gone; what was whole is kept: say the same again"
        )


def _done_there(
    expected: dict[str, str | None], work: Callable[..., Any], *given: Any, **named: Any
) -> Any:
    """On a worker: on one that came after the door was closed, too, versions must be ours."""
    if wrong := _differences(_own_versions(), expected):
        raise ClusterError(
            f"a worker joined that has {wrong}; install the same on all machines"
        )
    compute_on_one_thread()
    return work(*given, **named)


@cache
def _own_versions() -> dict[str, str | None]:
    return _that_count(get_versions(COUNTED))


def _local_cluster(count: int | None) -> LocalCluster:
    """Workers of this machine; only this machine can reach them."""
    return LocalCluster(
        n_workers=checked_count(count, processes_that_fit),
        threads_per_worker=1,
        processes=True,
        dashboard_address="127.0.0.1:0",  # else it would listen to everybody
        # on closing, workers complain of a scheduler that is gone
        silence_logs=logging.CRITICAL,
    )


def _client(address: str, own: LocalCluster | None) -> Client:
    in_file = address.endswith(".json")
    if not (own or in_file or address.startswith(PROTOCOLS)):
        raise ClusterError(
            f"no cluster '{address}'; take the address of a scheduler (tcp://host:8786 or tls://host:8786), the file "
            f"where it wrote it (.json), or {LOCAL} for this machine"
        )
    where = {"scheduler_file" if in_file else "address": own or address}
    try:
        if in_file and not Path(address).is_file():  # dask would wait for it
            raise FileNotFoundError("no such file")
        return Client(**where, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, KeyError) as error:
        raise ClusterError(
            f"nobody answers at {address} ({error}); start `dask scheduler` there and `dask worker {address}` on every "
            "machine, or check the name"
        ) from error


def _check_versions(client: Client, address: str) -> None:
    """Other versions give other results, or none."""
    found: Any = client.get_versions(packages=COUNTED)
    for worker, theirs in found["workers"].items():
        if wrong := _differences(_that_count(theirs), _own_versions()):
            raise ClusterError(
                f"the worker {worker} of {address} has {wrong}; install the same on all machines, such as with "
                "`pip install -c constraints.txt '.[cluster]'`"
            )


def _that_count(found: dict) -> dict[str, str | None]:
    """Versions that results, and talking to each other, depend on; a patch of Python changes neither."""
    python = ".".join(found["host"]["python"].split(".")[:2])
    return {"python": python} | {name: found["packages"][name] for name in COUNTED}


def _differences(theirs: dict, ours: dict) -> str:
    """What differs, in words; nothing if all is the same."""
    wrong = [name for name, version in ours.items() if theirs.get(name) != version]
    return ", ".join(
        f"{name} {theirs.get(name) or 'missing'} (here {ours[name]})" for name in wrong
    )
