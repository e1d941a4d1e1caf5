"""What a user gets back prints as a short text, not as its arrays."""

import subprocess
import sys

import numpy as np
import pytest

import s2c2a
from s2c2a.episodes import Episode
from s2c2a.estimation import EncoderEstimator, configuration_map_for
from s2c2a.planning.reach import Reached
from s2c2a.strategies import shipped_networks
from s2c2a.tasks import Score, Task
from s2c2a.viz.notebook import picture

LINES = 40
PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def shown(twin):
    """One value of each kind."""
    goal = s2c2a.Goal.of(twin.module_count).with_position([0.1, 0.0, 0.55])
    task = Task("short", (goal,) * 50, (Score("position"),))
    robot = s2c2a.SimulatedRobot(twin)
    strategy = s2c2a.pcc_strategy(twin)
    run = s2c2a.run(robot, strategy, task)
    with s2c2a.Loop(s2c2a.SimulatedRobot(twin), strategy) as loop:
        step = loop.tick(s2c2a.StepRequest(goal))
    estimate = EncoderEstimator(configuration_map_for(twin)).start(step.reading)
    numbers = np.zeros(50)
    return {
        "run": run,
        "task": task,
        "recording": s2c2a.Recording(twin, {}, (run, run)),
        "result": s2c2a.score_run(run, task)[0],
        "step": step,
        "reading": step.reading,
        "goal": goal,
        "estimate": estimate,
        "plan": strategy.plan(estimate, goal),
        "reached": Reached(*[numbers] * len(Reached._fields)),
    }


def test_nothing_prints_its_arrays(shown):
    for name, value in shown.items():
        text = str(value)
        assert len(text.splitlines()) <= LINES, name
        assert "array(" not in text, name


def test_a_run_tells_what_it_is(shown):
    run = shown["run"]
    begin = (
        f"<Episode of short on twin_arm: {len(run)} steps, {(len(run) - 1) / 10} s; "
    )
    assert str(run).startswith(f"{begin}columns time, stage, actions")
    assert str(shown["task"]) == "<Task short: 50 steps; scores position>"
    assert str(shown["recording"]).startswith("<Recording of twin_arm: 2 episodes, ")


def test_arms_strategies_and_networks_tell_what_they_are(twin):
    assert str(twin) == "twin_arm, 3 modules of 3 cables, 0.6 m, 0.24 kg, displacement"
    gripper = twin.tip.model_copy(update={"mass": 0.03})
    assert "0.27 kg with 30 g at the tip" in str(
        twin.model_copy(update={"tip": gripper})
    )
    strategy = s2c2a.pcc_strategy(twin)
    assert str(strategy) == (
        "<Strategy pcc on twin_arm: EncoderEstimator, Planner, InversePCC; "
        "sensors cables>"
    )
    networks = str(shipped_networks(twin))
    assert networks.startswith("<TrainedNetworks of s2c2a on twin_arm: C2S, C2A")


def test_notebooks_show_arms_and_runs_as_pictures_if_ends_were_measured(shown, twin):
    run = shown["run"]
    unseen = [name for name in run.columns if name != "sensor.states"]
    assert picture(twin).startswith(PNG)
    assert picture(run).startswith(PNG)
    assert picture(Episode(twin, {name: run[name] for name in unseen})) is None


def test_a_notebook_finds_the_pictures_by_importing_the_package():
    code = (
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "shell = InteractiveShell.instance()\n"
        "import s2c2a\n"
        "arm = s2c2a.load_arm('twin_arm')\n"
        "print(*shell.display_formatter.format(arm)[0])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    assert "image/png" in done.stdout


def test_single_numbers_are_shown_and_arrays_by_their_shape(shown):
    text = str(shown["goal"])
    assert "positions=f32[3,3](numpy)" in text
    assert "change_weight=0.5" in text
    value = shown["result"].value
    assert f"unit='cm', value={value!r}, averaged=True)" in str(shown["result"])
    assert "'states': f64[3,6](numpy)" in str(shown["step"])
