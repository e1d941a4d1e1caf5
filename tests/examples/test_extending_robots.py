"""A custom robot and a custom sensor, from user files, through the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import ArmSpec, save_arm
from s2c2a.cli.execution import robot_factory_for
from s2c2a.cli.main import main
from s2c2a.data import load_recording
from s2c2a.episodes import load_episodes
from s2c2a.estimation import configuration_map_for
from s2c2a.live.control import arm_control
from s2c2a.plugins.discovery import trust_code
from s2c2a.robots.factory import robot_class
from s2c2a.runtime import check_robot
from s2c2a.spaces import Stage
from s2c2a.strategies import load_networks, save_recipe
from waiting import until

FOLDER = Path(__file__).parents[2] / "examples" / "extending"
ROBOT, SENSOR = FOLDER / "own_robot.py", FOLDER / "own_sensor.py"


@pytest.fixture(scope="module")
def recipe(tiny_recipe, tmp_path_factory):
    """A recipe of tiny networks, in a file."""
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    return str(save_recipe(tiny_recipe, path))


def arm_file(arm, folder, **changes):
    """The arm in a file, changed."""
    path = folder / "arm.toml"
    save_arm(arm.model_copy(update={"name": "own_arm", **changes}), path)
    return path


@pytest.fixture(scope="module")
def recorded(twin, recipe, tmp_path_factory):
    """Arm file and recording of a custom robot in wall time at 50 Hz."""
    folder = tmp_path_factory.mktemp("own_robot")
    arm = arm_file(twin, folder, control_rate=50.0)
    robot = ["--robot", f"{ROBOT}:LaggingArm", "--arm", str(arm)]
    recording = folder / "own.episodes"
    few = ["--episodes", "3", "--samples", "80", "--recipe", recipe]
    main(["collect", *robot, "--out", str(recording), *few])
    return arm, recording


@pytest.fixture(scope="module")
def weights(recorded, recipe):
    """Networks that are trained on it."""
    recording = recorded[1]
    weights = recording.with_name("own.safetensors")
    main(["train", str(recording), "--out", str(weights), "--recipe", recipe])
    return weights


def test_a_custom_robot_fulfills_the_interface_contract(capsys, twin, tmp_path):
    arm = arm_file(twin, tmp_path, control_rate=20.0)
    robot = f"{ROBOT}:LaggingArm --robot-option lag=0.02"
    main(f"robot check --arm {arm} --robot {robot}".split())
    output = capsys.readouterr().out
    assert "ok: readings contain cables, states, as declared" in output
    assert "own_robot.py:LaggingArm lag=0.02 fulfills the interface contract" in output


@pytest.mark.slow
def test_a_custom_robot_is_recorded_in_wall_clock_time(recorded):
    _, recording = recorded
    loaded = load_recording(recording)
    assert set(loaded.sensors) == {"cables", "states"}
    assert loaded.actions.shape == (3, 80, 3, 3)
    assert "LaggingArm" in loaded.options["robot"]
    # a busy machine is late
    assert np.median(np.diff(loaded.time, axis=1)) > 0.8 * 0.02


@pytest.mark.slow
def test_a_custom_robot_is_run_and_scored(recorded, aside, run_errors, tmp_path):
    arm, _ = recorded
    options = f"--robot {ROBOT}:LaggingArm --strategy pcc".split()
    errors = run_errors(aside, "--arm", arm, *options)
    assert 0 < errors["pcc"] < 3
    rows = json.loads((tmp_path / "run" / "results.json").read_text())
    assert {(row["arm"], row["strategy"]) for row in rows} == {("own_arm", "pcc")}


@pytest.mark.slow
def test_a_custom_robot_runs_on_the_live_page(weights):
    spec = load_networks(weights).arm
    control = arm_control(
        spec, robot_factory_for(f"{ROBOT}:LaggingArm", ("lag=0.03",)), (str(weights),)
    )
    assert control.strategies[0] == "s2c2a · own"
    control.start()
    control.ask(driven=True, target=(0.05, 0.0, 0.59))

    def runs():
        return control.latest.stage is Stage.RUN and control.latest.step.number >= 60

    until(runs)
    assert control.latest.stage is Stage.RUN
    control.stop()
    assert control.latest.stage is Stage.IDLE
    np.testing.assert_allclose(control.latest.step.action, 0.0, atol=1e-9)


@pytest.mark.slow
def test_a_custom_sensor_is_checked_recorded_and_trained_on(
    twin, recipe, aside, run_errors, tmp_path, capsys
):
    arm = str(arm_file(twin, tmp_path, sensing=f"{SENSOR}:FlexMap"))
    robot = ["--robot", f"{SENSOR}:FlexArm", "--arm", arm]
    recording = str(tmp_path / "flex.episodes")
    main(["robot", "check", *robot])
    assert (
        "ok: readings contain cables, states, configurations, flex, as declared"
        in capsys.readouterr().out
    )
    few = ["--episodes", "3", "--samples", "60", "--recipe", recipe]
    main(["collect", *robot, "--out", recording, *few])
    assert load_recording(recording).sensor("flex").shape == (3, 60, 3, 2)
    weights = tmp_path / "flex.safetensors"
    main(["train", recording, "--arm", arm, "--out", str(weights), "--recipe", recipe])
    errors = run_errors(aside, *robot, "--weights", weights)
    assert np.isfinite(errors["s2c2a"])


@pytest.mark.slow
def test_a_missing_sensor_of_the_robot_is_reported(twin, tmp_path, refusal):
    arm = str(arm_file(twin, tmp_path, sensing=f"{SENSOR}:FlexMap"))
    recording = str(tmp_path / "no_flex.episodes")
    main(f"collect --arm {arm} --episodes 1 --samples 30 --out {recording}".split())
    out = str(tmp_path / "none.safetensors")
    assert "no 'flex'" in refusal("train", recording, "--arm", arm, "--out", out)


def test_flex_strips_measure_the_bends(twin):
    robot = robot_class(f"{SENSOR}:FlexArm")(twin)
    trust_code(f"{SENSOR}:FlexMap")
    arm = ArmSpec.model_validate(twin.model_dump() | {"sensing": f"{SENSOR}:FlexMap"})
    check_robot(robot)
    with robot:
        for _ in range(15):
            robot.step(np.tile([[-0.008, 0.004, 0.004]], (3, 1)))
        reading = robot.read()
    sensed = np.asarray(configuration_map_for(arm)(reading.sensors))
    np.testing.assert_allclose(sensed, reading["configurations"], atol=0.03)


BLIND = """
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading

class Blind(SimulatedRobot):
    @property
    def sensors(self):
        return {"cables": super().sensors["cables"]}

    def read(self):
        reading = super().read()
        return Reading(reading.time, {"cables": reading["cables"]})
"""


@pytest.mark.slow
def test_a_run_without_measured_states_is_saved_without_scores(tmp_path, capsys):
    (tmp_path / "blind.py").write_text(BLIND)
    (tmp_path / "path.csv").write_text("time,x,y,z\n0.5,0.05,0,0.58\n1,0.1,0,0.57\n")
    robot = f"--robot {tmp_path / 'blind.py'}:Blind --out {tmp_path / 'run'}"
    main(f"run {tmp_path / 'path.csv'} --strategy pcc {robot}".split())
    assert "run directory:" in capsys.readouterr().out
    assert json.loads((tmp_path / "run" / "results.json").read_text()) == []
    (run,), _ = load_episodes(tmp_path / "run" / "twin_arm.episodes")
    assert len(run.ran("actions")) == 10
