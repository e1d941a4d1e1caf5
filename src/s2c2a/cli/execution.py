"""Execution options that commands share: executor, run directory and robot."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.cli.console import Count, OptionalPath, progress_bar
from s2c2a.errors import S2C2AError
from s2c2a.execution.cache import cache_folder
from s2c2a.execution.executors import Processes, Serial, limit_jax_to_one_thread
from s2c2a.plugins.discovery import resolve, trust_code
from s2c2a.plugins.options import options_from, options_of
from s2c2a.robots.factory import NO_TRACKING, RobotFactory, robot_class

if TYPE_CHECKING:
    from s2c2a import arm, jobs
    from s2c2a.evaluation.rollout import OnStep

RobotName = Annotated[
    str,
    tyro.conf.arg(
        metavar="sim|dynamixel|feetech|MODULE:CLASS",
        help="the simulated arm, servos (dynamixel, feetech; docs/guides/hardware.md), "
        "or your own class, such as my_arm.py:MyArm.",
    ),
]
TrackingSource = Annotated[
    str,
    tyro.conf.arg(
        metavar="udp:PORT|natnet:HOST|qualisys:HOST|camera:...|FILE.py:Class|none",
        help="source of the poses of a real arm's module ends, such as udp:9763 or "
        "natnet:192.168.1.10 (docs/guides/tracking.md); by default that of the arm "
        "file.",
    ),
]
RobotOptions = Annotated[
    tuple[str, ...],
    tyro.conf.arg(metavar="KEY=VALUE ...", help="further arguments of that class."),
]
Stream = Callable[..., "AbstractContextManager[OnStep]"]
"""Called with the arm and options; what it yields is called with the record of every
step, and must be quick."""
StreamTarget = Annotated[str, tyro.conf.arg(metavar="foxglove|MODULE:FUNCTION")]
Address = Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")]


@dataclass(frozen=True)
class _WorkOptions:
    """Run directory and parallel execution; the results do not depend on the latter.

    Attributes:
        out: the run directory; by default a new one in runs/.
        overwrite: replace the run directory if it holds nothing but files of its run.
        jobs: parallel trainings and runs; all cores by default.
        cluster: use the workers of a dask scheduler: its address (tcp://host:8786, or
            its scheduler file), or local for one on this machine; docs/guides/cluster.md.
    """

    out: OptionalPath = None
    overwrite: bool = False
    jobs: Count = None
    cluster: Address = None


ALL_CORES = _WorkOptions()
Work = Annotated[_WorkOptions, tyro.conf.arg(name="")]


def make_executor(jobs: int | None = None, cluster: str | None = None) -> Executor:
    """Return processes of this machine, or the workers of a cluster.

    Args:
        jobs: number of processes on this machine; all cores if None.
        cluster: address of the cluster; None for this machine.

    Raises:
        S2C2AError: the cluster does not exist, its extra is not installed, or `jobs` is
            given for a cluster on other machines.
    """
    if cluster is None:
        return Processes(jobs)
    require("cluster", "distributed")
    from s2c2a.jobs.cluster import LOCAL, Cluster

    if jobs is not None and cluster != LOCAL:
        raise S2C2AError(
            f"--jobs {jobs} was given, but the workers of {cluster} are started "
            "elsewhere; leave out --jobs"
        )
    return Cluster(cluster, jobs)


def check_parallel(
    factory: RobotFactory, jobs: int | None, cluster: str | None, option: str = "--jobs"
) -> None:
    """Refuse to drive a robot of the user's own in several processes.

    Raises:
        S2C2AError: the robot is real, and parallel execution is given.
    """
    if not factory.simulated and (cluster or jobs not in (None, 1)):
        raise S2C2AError(
            f"{factory} is one arm, and is driven by one process at a time; leave out "
            f"{option} and --cluster"
        )


def uses_recipe(strategy: str) -> bool:
    """Whether a strategy, by name, uses any key of a recipe."""
    from s2c2a.strategies import strategy_named

    return bool(strategy_named(strategy).recipe_keys)


@contextmanager
def run_directory(
    label: str,
    options: dict,
    work: _WorkOptions,
    *,
    alone: bool = False,
    resume: bool = False,
    own_data: bool = False,
    keep_errors: bool = False,
) -> "Iterator[tuple[Path, jobs.Make]]":
    """Open a run directory; yield its path and a function that makes artifacts in it.

    Args:
        label: name of a directory that the user does not name.
        options: options of the command, saved in the directory.
        work: where the directory is, and the executor.
        alone: whether to work in this process, whatever `work` states.
        resume: whether to continue a directory with the same options.
        own_data: whether to keep recordings and networks in the directory, not in the
            cache.
        keep_errors: whether an error stands in the place of an artifact that failed,
            instead of being raised at the end.
    """
    from s2c2a import jobs
    from s2c2a.jobs.run_folder import open_run_directory

    limit_jax_to_one_thread()
    # no jobs are refused, also where none is started
    opened = (
        Serial() if alone and work.jobs != 0 else make_executor(work.jobs, work.cluster)
    )
    with opened as executor:
        directory = open_run_directory(work.out, label, options, work.overwrite, resume)
        data = directory / "data" if own_data else cache_folder()
        cache = jobs.Cache(data, directory / "runs")

        make_them = jobs.try_all if keep_errors else jobs.make_all

        def make(artifacts):
            with progress_bar() as progress:
                return make_them(artifacts, cache, executor, progress)

        yield directory, make


@contextmanager
def stream_to(target: str, spec: "arm.ArmSpec") -> "Iterator[OnStep]":
    """Open a stream of control steps to a viewer; without a target, show nothing.

    Args:
        target: name of a stream, with the options of its function behind commas, such
            as "foxglove,port=9000".
        spec: the arm.

    Raises:
        S2C2AError: there is no such stream or option, or it cannot be opened.
    """
    from s2c2a.evaluation.rollout import ignore_step

    if not target:
        yield ignore_step
        return
    name, *given = target.split(",")
    trust_code(name)
    open_stream: Stream = resolve("stream", name, {})
    with open_stream(spec, **options_of(open_stream, given)) as on_step:
        yield on_step


def require(extra: str, *packages: str) -> None:
    """Check that the packages of an extra are installed.

    Raises:
        S2C2AError: at least one is missing.
    """
    missing = [package for package in packages if find_spec(package) is None]
    if missing:
        raise S2C2AError(
            f"{', '.join(missing)} is missing; install it, in your clone of s2c2a, "
            f'with: pip install ".[{extra}]"'
        )


def robot_factory_for(
    robot: str,
    options: tuple[str, ...],
    fidelity: str = "fast",
    payload: float = 0.0,
    events: tuple[str, ...] = (),
    tracking: str = "",
) -> RobotFactory:
    """Return the description of a robot, from the options of a command.

    It does not open the robot.

    Raises:
        S2C2AError: no such class or option, or an option of the simulation is given for
            another robot.
    """
    pairs = options_from(options)
    if RobotFactory(robot).simulated:
        if tracking not in ("", NO_TRACKING):
            raise S2C2AError(
                f"--tracking {tracking} measures a real arm, and the simulated arm has "
                "true states; leave it out"
            )
        simulation = RobotFactory.simulation(
            fidelity, payload=payload, events="; ".join(events)
        )
        return RobotFactory(robot, (*simulation.options, *pairs))
    if fidelity != "fast" or payload or events:
        raise S2C2AError(
            "--fidelity, --payload and --event belong to the simulated arm, and --robot "
            f"is {robot}; leave them out"
        )
    robot_class(robot)  # raises an error early if the class does not exist
    return RobotFactory(robot, pairs, tracking)
