"""Jobs: runs of strategies on tasks; recordings and networks are made once and kept.

Example:
    cache = Cache()
    arm = load_arm("twin_arm")
    recipe = recipe_named("best")
    jobs = jobs_for(["circle", "tilt-50"], arm, ["s2c2a", "pcc"], range(3), recipe)
    runs = make_all(jobs, cache)  # in this process, one after the other
    with Processes() as executor:
        runs = make_all(jobs, cache, executor)  # on every core, with the same scores
    rows = score_rows("mine", runs)

Any `concurrent.futures` executor works, also dask's `client.get_executor()`;
`s2c2a.jobs.cluster.Cluster` adds a check of versions to it.
"""

from s2c2a.execution.executors import Processes, Serial, Threads
from s2c2a.jobs.artifacts import (
    Artifact,
    Cache,
    GivenNetworks,
    Networks,
    NetworksArtifact,
    RecordingArtifact,
)
from s2c2a.jobs.execution import Make, check_robots, in_groups, made, make_all, try_all
from s2c2a.jobs.job import Conditions, Job, Run, checked_seeds, jobs_for
from s2c2a.jobs.prior import PriorNetworks
from s2c2a.jobs.rows import Heading, describe_repetitions, score_rows, training_rows
