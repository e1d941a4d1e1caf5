"""Workers on other machines, managed by a dask scheduler (extra `cluster`)."""

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
from s2c2a.execution.child import safe_path
from s2c2a.execution.executors import (
    default_process_count,
    limit_jax_to_one_thread,
    validated_worker_count,
)
from s2c2a.execution.sources import code_digest
from s2c2a.execution.versions import PACKAGES
from s2c2a.jobs.job import Job

LOCAL = "local"
PROTOCOLS = ("tcp://", "tls://")
CHECKED_PACKAGES = ("s2c2a", *PACKAGES, "distributed")
PATIENCE = 15  # s; time for a scheduler to answer

Versions = dict[str, str | None]


class Cluster(ClientExecutor):
    """An executor on the workers of a dask scheduler.

    Workers that join later take part; calls of lost workers run again. This is dask's
    executor with a check of versions and with errors that say what to do. Leaving the
    context closes the client.

    Args:
        address: of the scheduler, such as tcp://host:8786; its scheduler file (.json);
            or "local" for a scheduler and workers on this machine.
        count: workers of "local"; one for every core if None.

    Raises:
        ClusterError: the address is invalid, no scheduler answers, or workers have
            other versions than this process.
    """

    def __init__(self, address: str, count: int | None = None):
        self._address = address
        self._versions = _own_versions()
        with ExitStack() as resources:
            if address == LOCAL:
                # of this machine, which other machines cannot reach
                resources.enter_context(safe_path())
                local = resources.enter_context(
                    LocalCluster(
                        n_workers=validated_worker_count(count, default_process_count),
                        threads_per_worker=1,
                        processes=True,
                        # the default listens on all interfaces
                        dashboard_address="127.0.0.1:0",
                        # closing workers log that the scheduler is gone
                        silence_logs=logging.CRITICAL,
                    )
                )
                client = _connect(LOCAL, address=local)
            else:
                client = _connect_to(address)
            resources.callback(client.close)
            # other versions could give other results or fail
            found: Any = client.get_versions(packages=CHECKED_PACKAGES)
            for worker, versions in found["workers"].items():
                # every call compares the sources, which dask does not know
                theirs = self._versions | _checked_versions(versions)
                differences = _differences(theirs, self._versions)
                if differences:
                    raise ClusterError(
                        f"the worker {worker} of {address} has {differences}; install the same "
                        "versions on all machines, for example with "
                        "`pip install -c constraints.txt '.[cluster]'`"
                    )
            self._resources = resources.pop_all()
        super().__init__(client, pure=False)

    def submit(self, fn, *args, **kwargs) -> Future:  # type: ignore[override] # as dask
        """Call a function on a worker.

        Raises:
            ClusterError: the scheduler is lost.
        """
        try:
            return super().submit(_call, self._versions, fn, *args, **kwargs)
        except OSError as error:
            raise self._lost() from error

    @property
    def workers(self) -> int:
        """Number of parallel calls, which changes as workers join and leave.

        Raises:
            ClusterError: the scheduler is lost.
        """
        try:
            return max(1, sum(self._client.nthreads().values()))
        except OSError as error:
            raise self._lost() from error

    def __exit__(self, kind, error, trace):
        """Cancel unfinished calls and close the client and local workers.

        Raises:
            ClusterError: the scheduler is lost, or a call kills its workers.
        """
        self._resources.close()
        if isinstance(error, CancelledError):
            raise self._lost() from error
        if isinstance(error, KilledWorker):
            raise ClusterError(
                f"several workers at {self._address} were killed by one job, perhaps "
                "for lack of memory; give each more (docs/guides/cluster.md) and repeat the "
                "command: finished results are kept"
            ) from error

    def _lost(self) -> ClusterError:
        return ClusterError(
            f"the scheduler at {self._address} is gone; "
            "repeat the command: finished results are kept"
        )


def _call(
    expected: Versions, function: Callable[..., Any], *args: Any, **kwargs: Any
) -> Any:
    """Check the versions of a worker that may have joined late, and call a function."""
    differences = _differences(_own_versions(), expected)
    if differences:
        raise ClusterError(
            f"a worker joined that has {differences}; "
            "install the same versions on all machines"
        )
    limit_jax_to_one_thread()
    return function(*args, **kwargs)


@cache
def _own_versions() -> Versions:
    # sources may differ within a version
    sources = {"sources": code_digest(Job)}
    return _checked_versions(get_versions(CHECKED_PACKAGES)) | sources


def _connect_to(address: str) -> Client:
    if address.endswith(".json"):
        return _connect(address, scheduler_file=address)
    if address.startswith(PROTOCOLS):
        return _connect(address, address=address)
    raise ClusterError(
        f"no cluster '{address}'; give the address of a scheduler (tcp://host:8786 or "
        f"tls://host:8786), its scheduler file (.json), or {LOCAL} for this machine"
    )


def _connect(name: str, **where: Any) -> Client:
    file = where.get("scheduler_file")
    try:
        if file and not Path(file).is_file():  # dask would wait for it
            raise FileNotFoundError("no such file")
        return Client(**where, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, KeyError) as error:
        raise ClusterError(
            f"no scheduler answers at {name} ({error}); start `dask scheduler` there "
            f"and `dask worker {name}` on every machine, or check the address"
        ) from error


def _checked_versions(found: dict) -> Versions:
    """Versions of Python, without its patch level, and of the packages that matter."""
    python = ".".join(found["host"]["python"].split(".")[:2])
    packages = {name: found["packages"][name] for name in CHECKED_PACKAGES}
    return {"python": python, **packages}


def _differences(theirs: Versions, ours: Versions) -> str:
    """Packages whose versions differ, as text; empty if there is none."""
    return ", ".join(
        f"{name} {theirs.get(name) or 'missing'} (here {version})"
        for name, version in ours.items()
        if theirs.get(name) != version
    )
