"""Who does the work of a verb: this machine's cores, or a cluster."""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.shards import Crew

Address = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="ADDRESS",
        help="of a dask scheduler (tcp://host:8786, or the file where it wrote it), or local for one on this machine; "
        "docs/cluster.md",
    ),
]


def crew_for(jobs: int | None, cluster: str | None) -> "Crew":
    """Processes of this machine, or the workers of a cluster.

    Args:
        jobs: side by side on this machine; all cores if None.
        cluster: its address; none if None.

    Raises:
        S2C2AError: no such cluster, its extra is missing, or a number that belongs to another machine.
    """
    from s2c2a.shards import Processes

    if cluster is None:
        return Processes(jobs)
    require("cluster", "distributed")
    from s2c2a.experiments.cluster import LOCAL, Cluster

    if jobs is not None and cluster != LOCAL:
        raise S2C2AError(f"{jobs} side by side asked for; how many workers {cluster} has is said where they start")
    return Cluster(cluster, jobs)


def require(extra: str, *packages: str) -> None:
    """Say what to install where a package of an extra is missing.

    Raises:
        S2C2AError: one is.
    """
    if missing := [package for package in packages if find_spec(package) is None]:
        raise S2C2AError(
            f'{", ".join(missing)} is missing; install it, in your clone of s2c2a, with: pip install ".[{extra}]"'
        )
