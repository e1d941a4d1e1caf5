"""An error names the steps of an interrupted run only if this run saved them."""

import pytest

from s2c2a import evaluation
from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.jobs import Cache, Job
from s2c2a.strategies import recipe_named
from s2c2a.tasks import load_task

ARM = load_arm("twin_arm")


@pytest.fixture
def job():
    return Job(load_task("circle", ARM), ARM, "pcc", recipe_named("best"))


def test_an_earlier_interrupted_run_is_not_taken_for_this_one(
    job, tmp_path, monkeypatch
):
    def fail(*_, **__):
        raise S2C2AError("the port is in use")

    monkeypatch.setattr(evaluation, "rollout", fail)
    earlier = job.path(Cache(tmp_path)).with_name(f"interrupted-{job.file}")
    earlier.parent.mkdir(parents=True, exist_ok=True)
    earlier.touch()
    with pytest.raises(S2C2AError) as caught:
        job._episodes(None, lambda done, total: None, Cache(tmp_path))
    assert str(caught.value) == "the port is in use"
