"""A small version of the stability campaign: a held point under unknown payloads."""

import pytest

from s2c2a.jobs import Cache, GivenNetworks, jobs_for, make_all
from s2c2a.jobs.job import Conditions
from s2c2a.robots import RobotFactory
from s2c2a.strategies import recipe_named, save_networks, shipped_networks
from s2c2a_experiments.sensors import with_sensors
from s2c2a_experiments.stability import (
    HOLD_TIME,
    MAX_PEAK_TO_PEAK,
    StabilityStudy,
    hold_task,
    rows_of,
    stability_rows,
    vibrating,
)


def test_the_campaign_asks_for_holds_and_pushed_circles_of_every_case(twin, asked):
    study = StabilityStudy((twin,), ("imu", "camera"), (0.0, 0.1))
    jobs = asked(stability_rows, study)
    assert len(jobs) == 4 * 3 * 2  # tasks, sets with the compared one, payloads
    holds = {f"hold-point-{number}" for number in (1, 2, 3)}
    assert {job.task.name for job in jobs} == {*holds, "circle"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensors", "seconds", "most"),
    [
        # a shorter hold judges an estimate of the payload that still settles
        ("imu", HOLD_TIME, MAX_PEAK_TO_PEAK),
        # the estimate of the payload still creeps
        pytest.param("bends", HOLD_TIME, 1.5, marks=pytest.mark.slow),
    ],
)
def test_a_held_arm_with_100_g_does_not_vibrate(sensors, seconds, most, twin, tmp_path):
    path = tmp_path / "twin.safetensors"
    save_networks(shipped_networks(twin), path)
    arm = with_sensors(twin, sensors)
    given = GivenNetworks.read(path, twin)
    conditions = Conditions(RobotFactory.simulation(payload=0.1))
    jobs = jobs_for(
        [hold_task(twin, 0, seconds)],
        arm,
        ["s2c2a"],
        [0],
        recipe_named("best"),
        conditions,
        given,
    )
    cache = Cache(tmp_path / "data", tmp_path / "runs")
    rows = rows_of(make_all(jobs, cache), f"{sensors}, 100 g")
    values = {row.metric: row.mean for row in rows}
    assert values["peak to peak, last two thirds"] <= most
    assert values["position, last quarter"] <= 1.0
    moved = values["peak to peak, last two thirds"] > MAX_PEAK_TO_PEAK
    assert bool(vibrating(rows)) == moved
