"""Own estimators, sensors with a formula, controllers and strategies, by command line."""

from importlib import resources
from pathlib import Path

import pytest
import tomli_w

from s2c2a.cli.main import main
from s2c2a.strategies import load_networks

EXTENDING = Path(__file__).parents[2] / "examples" / "extending"
WEIGHTS = resources.files("s2c2a.strategies") / "weights" / "twin_arm.safetensors"


@pytest.fixture(scope="module")
def waypoints(tmp_path_factory) -> Path:
    """A path of three seconds."""
    path = tmp_path_factory.mktemp("task") / "short.csv"
    path.write_text("time,x,y,z\n0,0,0,0.6\n3,0.08,0.0,0.58\n8,0.08,0.0,0.58\n")
    return path


@pytest.mark.slow
def test_an_own_estimator_is_named_by_a_recipe(waypoints, run_errors):
    options = ("--weights", WEIGHTS, "--recipe", EXTENDING / "own_estimator.toml")
    assert run_errors(waypoints, *options)["s2c2a"] < 3.0


@pytest.mark.slow
def test_a_sensor_with_a_formula_is_named_by_the_arm_file(
    waypoints, run_errors, tmp_path
):
    arm = tmp_path / "string_arm.toml"
    main(["arm", "copy", "twin_arm", str(arm)])
    file = EXTENDING / "own_raw_sensor.py"
    entry = {"name": "strings", "shape": [3, 2], "model": f"{file}:Strings"}
    text = arm.read_text()
    place = text.index("[[modules]]")
    table = tomli_w.dumps({"sensors": {"raw": [entry]}})
    arm.write_text(f"{text[:place]}{table}\n{text[place:]}")
    robot = ("--robot", f"{file}:StringArm", "--robot-option", "payload=0.05")
    errors = run_errors(waypoints, "--arm", arm, "--weights", WEIGHTS, *robot)
    assert errors["s2c2a"] < 3.0


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("data") / "mine.episodes"
    main(["collect", "--episodes", "3", "--samples", "60", "--out", str(path)])
    return path


@pytest.mark.slow
def test_an_own_controller_is_trained_saved_and_run(
    recording, waypoints, run_errors, tmp_path
):
    recipe = tmp_path / "quick.toml"
    own = f"{EXTENDING / 'own_controller.py'}:LinearOptions"
    quick = {"learning_rate": 1e-2, "max_epochs": 4, "epochs_per_call": 4}
    table = {"based_on": "best", "c2a": {"model": own}, "c2s_fit": quick}
    recipe.write_text(tomli_w.dumps(table))
    weights = tmp_path / "mine.safetensors"
    main(["train", str(recording), "--recipe", str(recipe), "--out", str(weights)])
    errors = run_errors(waypoints, "--weights", weights, "--trust", own)
    assert errors["s2c2a"] < 10.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [f"{EXTENDING / 'own_strategy.py'}:ResolvedRate", "pcc-fitted"],
    ids=["own", "fitted"],
)
def test_a_strategy_is_trained_and_compared_in_one_table(
    name, recording, waypoints, run_errors, tmp_path
):
    weights = tmp_path / "own.safetensors"
    main(["train", str(recording), "--strategy", name, "--out", str(weights)])
    assert load_networks(weights).strategy == Path(name).name.replace(".py", "")
    errors = run_errors(waypoints, "--strategy", "pcc", name, "--weights", weights)
    assert set(errors) == {"pcc", name}
    assert errors[name] < 10.0
