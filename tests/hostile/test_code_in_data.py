"""Recordings, weight files and cached results run no code, whatever names they hold."""

import ast
import contextlib
import sys
import tomllib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import ArmSpec, arm_from_toml, load_arm, save_arm
from s2c2a.arm.sensors import Raw, Sensors
from s2c2a.arm.tracking import Tracking
from s2c2a.cli.main import main
from s2c2a.data import load_recording
from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.errors import S2C2AError, UntrustedCodeError
from s2c2a.estimation import KalmanFilter, configuration_map_for
from s2c2a.estimation.sensor_models import sensor_models_of
from s2c2a.execution.executors import submit
from s2c2a.lab.tracking import tracker_of
from s2c2a.logs.arm_file import CableLayout, format_arm
from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.cable_search import Assignment
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.model_fit import CableFit
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.plugins.components import CustomComponent, Registry
from s2c2a.plugins.discovery import GROUPS, resolve, trust_code
from s2c2a.robots import RobotFactory
from s2c2a.strategies import (
    load_networks,
    load_recipe,
    s2c2a_strategy,
    save_networks,
    save_recipe,
)

SOURCE = Path(__file__).parents[2] / "src" / "s2c2a"
EVIL = """
from pathlib import Path
Path(__file__).with_name("ran").touch()
def X(*_):
    pass
"""
IMPORTING = {"import_module", "importlib", "__import__", "entry_points", "exec"}
IMPORTING |= {"eval", "runpy", "resolve_name", "pickle", "spec_from_file_location"}
NAMES = ("evil_code.py:X", "./evil_code.py:X", "evil_code:X", "this:s", "os:system")
CUSTOM = CustomComponent("evil_code.py:X")
MAP = """
[rows]
kind = "steps"
[arm]
name = "mine"
modules = 3
control_rate = 10
cable_radius = 0.02
[[drives]]
commanded = "a"
unit = "free"
[[ends]]
position = ["x", "y", "z"]
unit = "m"
"""


@pytest.fixture(autouse=True)
def ran(tmp_path, monkeypatch) -> Path:
    """The file that exists once the code has run."""
    (tmp_path / "evil_code.py").write_text(EVIL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for module in ("evil_code", "this"):
        sys.modules.pop(module, None)
    return tmp_path / "ran"


def all_of(kind: type) -> list:
    """Every registry of the package, those of later versions too."""
    modules = [module for name, module in sys.modules.items() if "s2c2a." in name]
    found = [v for module in modules for v in vars(module).values()]
    return list(
        {id(value): value for value in found if isinstance(value, kind)}.values()
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", GROUPS)
def test_no_group_imports_a_name_that_the_user_has_not_given(kind, name, ran):
    with pytest.raises(UntrustedCodeError, match=f"--trust {name}"):
        resolve(kind, name, {})
    assert not ran.exists()
    assert "this" not in sys.modules


@pytest.mark.parametrize("kind", GROUPS)
def test_every_group_imports_a_name_that_the_user_has_given(kind, ran):
    trust_code("evil_code.py:X")
    assert callable(resolve(kind, "evil_code.py:X", {}))
    assert ran.exists()


@pytest.mark.parametrize("registry", all_of(Registry), ids=lambda r: r.kind)
def test_no_registry_imports_what_a_recipe_or_a_weight_file_names(registry, ran):
    assert registry.kind in GROUPS
    of_recipe = registry.read({"name": "evil_code.py:X"})
    with pytest.raises(UntrustedCodeError):
        registry.build(of_recipe)
    for find in (registry.imported, registry.find):
        with pytest.raises(UntrustedCodeError):
            find("evil_code.py:X")
    assert not ran.exists()


def test_only_the_gate_imports_by_name():
    """Other imports by name take constants of the package."""
    importers = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            words = {getattr(node, "id", ""), getattr(node, "attr", "")}
            if isinstance(node, ast.ImportFrom | ast.Import):
                words = {alias.name for alias in node.names}
            if words & IMPORTING:
                importers.add(path.relative_to(SOURCE).as_posix())
    constants = {"execution/after_import.py", "live/cli/live.py"}
    # of files that entry points name; it imports nothing
    readers = {"execution/sources.py"}
    own = {"execution/executables.py"}  # pickles that only this user can have written
    assert importers == {"plugins/discovery.py"} | constants | readers | own


def with_raw_sensor(arm: ArmSpec, name: str) -> ArmSpec:
    raw = Raw(name="strings", shape=(3,), model=name)
    return arm.model_copy(update={"sensors": Sensors(raw=(raw,))})


def with_sensing(arm: ArmSpec, name: str) -> ArmSpec:
    return arm.model_copy(update={"sensing": name})


def with_tracking(arm: ArmSpec, name: str) -> ArmSpec:
    return arm.model_copy(update={"tracking": Tracking(source=name)})


USES = {
    "sensing": (with_sensing, configuration_map_for),
    "sensors.raw": (
        with_raw_sensor,
        lambda arm: sensor_models_of(arm, PCCForwardModel.of(arm), {}),
    ),
    "tracking": (with_tracking, lambda arm: tracker_of(arm.tracking.source)),
}
"""Names of code in an arm: how the arm has it, and what would import it."""


@pytest.mark.parametrize("name", ["evil_code.py:X", "this:s"])
@pytest.mark.parametrize("place", USES)
def test_the_arm_of_a_recording_runs_no_code(place, name, ran, recording, tmp_path):
    change, use = USES[place]
    arm = change(recording.arm, name)
    episode = replace(recording.episodes[0], arm=arm)
    save_episodes([episode], tmp_path / "evil.episodes")
    loaded = load_episodes(tmp_path / "evil.episodes")[0][0].arm
    with pytest.raises(UntrustedCodeError, match="--arm"):
        use(loaded)
    assert not ran.exists()
    assert "this" not in sys.modules
    save_arm(arm, tmp_path / "mine.toml")
    load_arm(tmp_path / "mine.toml")  # the user gives the arm file
    with pytest.raises(S2C2AError) as error:  # X is none of these classes
        use(loaded)
    assert not isinstance(error.value, UntrustedCodeError)


def test_a_robot_does_not_import_the_tracker_of_an_arm_in_a_recording(ran, twin):
    with pytest.raises(S2C2AError):
        RobotFactory("dynamixel").make(with_tracking(twin, "evil_code.py:X"))
    assert not ran.exists()


@pytest.mark.parametrize("name", ["evil_code.py:X", "this:s"])
def test_weights_of_an_arm_with_a_sensor_formula_run_no_code(
    name, ran, tiny_best_networks, tmp_path
):
    recipe = replace(tiny_best_networks.recipe, estimator=KalmanFilter())
    arm = with_raw_sensor(tiny_best_networks.arm, name)
    networks = replace(tiny_best_networks, arm=arm, recipe=recipe)
    save_networks(networks, tmp_path / "evil.safetensors")
    loaded = load_networks(tmp_path / "evil.safetensors")
    with pytest.raises(UntrustedCodeError, match=name):
        s2c2a_strategy(loaded)
    assert not ran.exists()
    assert "this" not in sys.modules


@pytest.mark.parametrize("field", ["solver", "terms", "guides"])
def test_the_planner_of_a_weight_file_runs_no_code(
    field, ran, tiny_best_networks, tmp_path
):
    recipe = tiny_best_networks.recipe
    own = (CUSTOM,) if field in ("terms", "guides") else CUSTOM
    planner = replace(recipe.planner, **{field: own})
    networks = replace(tiny_best_networks, recipe=replace(recipe, planner=planner))
    save_networks(networks, tmp_path / "evil.safetensors")
    loaded = load_networks(tmp_path / "evil.safetensors")
    with pytest.raises(UntrustedCodeError):
        s2c2a_strategy(loaded)
    assert not ran.exists()
    save_recipe(loaded.recipe, tmp_path / "mine.toml")
    with pytest.raises(S2C2AError, match="is no"):  # the user gives the recipe file
        load_recipe(tmp_path / "mine.toml")
    assert ran.exists()


def test_train_runs_no_code_of_a_recording_without_its_arm_file(
    ran, recording, tmp_path, refusal
):
    arm = with_sensing(recording.arm, "evil_code.py:X")
    episodes = [replace(episode, arm=arm) for episode in recording.episodes]
    save_episodes(episodes, tmp_path / "evil.episodes")
    load_recording(tmp_path / "evil.episodes")
    command = ["train", "evil.episodes", "--out", "w.safetensors"]
    message = refusal(*command)
    assert "--arm" in message
    assert "--trust evil_code.py:X" in message
    assert not ran.exists()
    save_arm(arm, tmp_path / "mine.toml")
    for allowed in (["--arm", "mine.toml"], ["--trust", "evil_code.py:X"]):
        assert "name a subclass" in refusal(*command, *allowed)
        assert ran.exists()
        ran.unlink()
        sys.modules.pop("evil_code")
        refusal(*command)  # the next command starts without trust
        assert not ran.exists()


def test_train_refuses_an_arm_that_the_recording_is_not_of(
    recording, tmp_path, refusal
):
    save_episodes(list(recording.episodes), tmp_path / "r.episodes")
    command = "train r.episodes --arm simulated_arm --out w.safetensors"
    assert "differs from simulated_arm in" in refusal(*command.split())


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("good:X,evil.py", "good:X,evil.py:X"),
        ("good:X,/folder/evil.py", "good:X,/folder/evil.py:X"),
        ("good:X,evil.py", "good:X,evil:X"),
    ],
)
def test_a_name_that_begins_as_a_trusted_one_is_not_trusted(tmp_path, file, name):
    (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / file).write_text(EVIL)
    trust_code("good:X")
    with pytest.raises(UntrustedCodeError):
        resolve("sensor", name, {})
    assert not list(tmp_path.rglob("ran"))


def test_code_in_a_folder_with_a_comma_is_trusted_by_its_whole_name(tmp_path):
    (tmp_path / "data,2").mkdir()
    (tmp_path / "data,2" / "comma_code.py").write_text(EVIL)
    trust_code("data,2/comma_code.py:X")
    resolve("sensor", "data,2/comma_code.py:X", {})
    assert (tmp_path / "data,2" / "ran").exists()


def test_the_options_of_a_tracker_do_not_belong_to_its_trusted_name(ran):
    trust_code("evil_code.py:X,port=1")
    resolve("tracker", "evil_code.py:X", {})
    assert ran.exists()


@pytest.mark.parametrize("text", ["", "circle"])
def test_a_trusted_name_that_is_no_code_is_refused(text, refusal):
    message = refusal("arm", "check", "twin_arm", "--trust", text)
    assert "names no code" in message


def test_a_worker_trusts_what_its_parent_trusts(ran):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        with pytest.raises(UntrustedCodeError):
            submit(executor, resolve, "task", "evil_code.py:X", {}).result()
        assert not ran.exists()
        trust_code("evil_code.py:X")
        submit(executor, resolve, "task", "evil_code.py:X", {}).result()
    assert ran.exists()


@pytest.mark.parametrize("name", NAMES)
def test_the_description_of_an_arm_file_allows_no_code(name, twin, tmp_path):
    """It may be a stranger's text, which `s2c2a import` copies from the map."""
    arm = twin.model_copy(update={"description": name})
    save_arm(arm, tmp_path / "mine.toml")
    load_arm(tmp_path / "mine.toml")
    with pytest.raises(UntrustedCodeError):
        resolve("sensor", name, {})


@pytest.mark.parametrize("breaks", ["\n", "\r\n", "\x0b", "\u2028", "\x00"])
def test_names_in_a_map_add_no_key_to_the_arm_file(breaks):
    text = f'x{breaks}sensing = "evil_code.py:X"{breaks}#'
    table = tomllib.loads(MAP)
    drive = table["drives"][0] | {"commanded": text, "module": 0}
    table |= {"source": {"name": text}, "drives": [drive] * 3}
    table["arm"]["modules"] = 1
    zero = np.zeros(3)
    parameters = CableParameters(
        zero, 0.0, zero, zero, np.zeros(1), 0.0, 0.0, zero, zero
    )
    layout = CableLayout(
        np.ones((1, 3), bool),
        np.array([[0, 1, 2]]),
        np.ones((1, 3)),
        np.array([[0.0, 120.0, 240.0]]),
        np.array([0.02]),
        np.ones((1, 3)),
    )
    log_map = LogMap.model_validate(table)
    fit = CableFit(parameters, None, 0.0)
    assignment = Assignment(np.zeros(3, int), np.ones(3), False)
    bends = np.zeros((2, 1, 2))
    cables = np.zeros((2, 1, 3))
    written = format_arm(fit, assignment, layout, log_map, bends, [cables], cables, 0.0)
    assert arm_from_toml(written).sensing == "encoders"


def evil(arm: ArmSpec) -> ArmSpec:
    """The arm, which names code wherever it can."""
    for change, _ in USES.values():
        arm = change(arm, "evil_code.py:X")
    return arm


@pytest.fixture
def evil_recording(recording, tmp_path) -> str:
    """A recording whose arm, options and columns name code wherever they can."""
    arm = evil(recording.arm)
    options = ("strategy", "task", "recipe", "robot", "estimator", "babbling")
    named = dict.fromkeys(options, "evil_code.py:X")
    episodes = [replace(e, arm=arm, options=named) for e in recording.episodes]
    path = tmp_path / "evil.episodes"
    save_episodes(episodes, path, {**recording.options, **named})
    return str(path)


@pytest.fixture
def evil_weights(tiny_best_networks, tmp_path) -> str:
    """Networks whose arm and recipe name code wherever they can."""
    recipe = tiny_best_networks.recipe
    own = {"solver": CUSTOM, "terms": (CUSTOM,), "guides": (CUSTOM,)}
    planner = replace(recipe.planner, **own)
    recipe = replace(recipe, planner=planner, estimator=CUSTOM)
    arm = evil(tiny_best_networks.arm)
    path = tmp_path / "evil.safetensors"
    save_networks(replace(tiny_best_networks, arm=arm, recipe=recipe), path)
    return str(path)


COMMANDS = {
    "train": "train evil.episodes --out w.safetensors",
    "from": "train evil.episodes --from evil.safetensors --out w.safetensors",
    "run": "run circle --weights evil.safetensors --out runs/a",
    "like": "import log.csv --map map.toml --like evil.episodes --out b.episodes",
    "view": "view evil.episodes --port 0",
    "weights": "view evil.safetensors --port 0",
    "arm": "arm check evil.episodes",
    "recipe": "run circle --recipe evil.safetensors",
}
"""What a user may do with files of a stranger."""


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_no_command_runs_the_code_that_data_names(
    command, ran, evil_recording, evil_weights, tmp_path, monkeypatch, capsys
):
    """Most end with an error; some do their work without the code."""
    (tmp_path / "map.toml").write_text(MAP)
    (tmp_path / "log.csv").write_text("time,a,b,c,x,y,z\n0,1,2,3,0,0,0.6\n" * 9)
    monkeypatch.setattr("s2c2a.live.cli.view.wait_for_interrupt", lambda: None)
    path = list(sys.path)
    with contextlib.suppress(SystemExit):
        main(command.split())
    assert not ran.exists()
    assert "evil_code" not in sys.modules
    assert sys.path == path
    for written in tmp_path.glob("*.toml"):
        assert "evil_code" not in written.read_text()
