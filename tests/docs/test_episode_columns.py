"""The page of episode columns names the columns of real episodes, no others."""

import re
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, collect
from s2c2a.episodes import Episode
from s2c2a.episodes.episode import SENSOR
from s2c2a.estimation import Estimate
from s2c2a.evaluation import rollout
from s2c2a.planning import PAPER, Outcome
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading, Stage
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import load_task

from tools import ROOT

PAGE = (ROOT / "docs" / "reference" / "episodes.md").read_text(encoding="utf-8")
COLUMN = re.compile(
    r"^\| `(?P<name>[\w.]+)` \| `(?P<shape>\([^`]*\))` \|", re.MULTILINE
)
SENSORS = {"imu": {}, "camera": {"rate": 10.0, "lost": 0.0, "sees": "ends"}, "flex": {}}
OF_TRACKERS = {"sensor.states_age"}
OF_REPETITIONS = {"target_offsets"}
OF_HORIZONS = {"horizon"}
DIMENSIONS = {"()": 0, "(modules,)": 1, "(samples, points, 3)": 3}


def documented() -> dict[str, int]:
    """Number of axes of a row, by the column's name."""
    return {
        column["name"]: DIMENSIONS.get(column["shape"], column["shape"].count(",") + 1)
        for column in COLUMN.finditer(PAGE)
    }


@pytest.fixture(scope="module")
def sensing_arm(twin) -> ArmSpec:
    table = twin.model_dump() | {"sensors": SENSORS}
    table["motor"] |= {"current_noise": 0.1}
    return ArmSpec.model_validate(table)


@pytest.fixture(scope="module")
def recorded(sensing_arm, tmp_path_factory) -> Episode:
    def robot(seed):
        return SimulatedRobot(sensing_arm, seed=seed, center_line=True)

    path = tmp_path_factory.mktemp("reference") / "sensors.episodes"
    options = CollectOptions(episodes=1, samples=4)
    return collect(path, sensing_arm, robot, options).episodes[0]


@pytest.fixture(scope="module")
def run(twin) -> Episode:
    task = load_task("risk-a", twin)
    short = replace(task, goals=[task.goals[0]] * 2)
    return rollout(SimulatedRobot(twin), pcc_strategy(twin, PAPER), short)


def estimate_columns() -> dict[str, np.ndarray]:
    """Columns of an estimator that uses a camera."""
    estimate = Estimate.of(np.tile([0.0, 0.0, 1.0], (3, 1)), 0.05)
    zero = jnp.zeros(())
    estimate = estimate._replace(external_force=zero, rejected={"NAME": zero})
    return estimate.diagnostics()


def test_the_page_names_the_columns_of_a_recording_and_of_a_run(recorded, run):
    found = {name: values.ndim - 1 for name, values in recorded.columns.items()}
    found |= {name: values.ndim - 1 for name, values in run.columns.items()}
    found |= {name: values.ndim for name, values in estimate_columns().items()}
    rest = OF_TRACKERS | OF_REPETITIONS | OF_HORIZONS | {"desired_axes"}
    assert found == {
        name: axes for name, axes in documented().items() if name not in rest
    }


def test_the_page_names_the_columns_of_the_docstrings():
    text = f"{Episode.__doc__}"
    names = set(re.findall(r"`([a-z_]+(?:\.NAME)?)`", text.split("Attributes:")[0]))
    own = {name for name in documented() if not name.startswith(SENSOR)}
    assert names - {"sensor.NAME"} == own
    table = Reading.__doc__.split("True states come")[0]
    sensors = set(re.findall(r"`([a-z_]+)`", table))
    assert {SENSOR + name for name in sensors} == documented().keys() - own


def test_the_page_explains_the_numbers_of_stages_and_outcomes():
    stages = [f"| {int(stage)} | `{stage.name}` | {stage} |" for stage in Stage]
    text = " ".join(f"{Outcome.__doc__}".split())
    meanings = re.findall(r"([A-Z_]{5,}): (.*?)(?= [A-Z_]{5,}:|$)", text)
    outcomes = [
        f"| {int(Outcome[name])} | `{name}` | {meaning[0].upper()}{meaning[1:]} |"
        for name, meaning in meanings
    ]
    assert len(outcomes) == len(Outcome)
    assert [row for row in stages + outcomes if row not in PAGE] == []
