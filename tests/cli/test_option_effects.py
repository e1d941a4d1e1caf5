"""Every accepted option of every command has an effect, or is refused."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator

import pytest
from tyro.extras import SubcommandApp

from s2c2a.cli.dependent_options import beside, conditions_of
from s2c2a.cli.execution import check_parallel
from s2c2a.cli.main import app
from s2c2a.errors import S2C2AError
from s2c2a.robots import RobotFactory

REFUSED = {
    "train a.episodes --out x.safetensors --strategy lstm --recipe paper": ["recipe"],
    "reach --csv path.csv --axis 0 0 1 --module 2": ["axis", "module"],
    "reach --target 0 0 0.5 --payload-g 50": ["payload_g"],
    "run circle --axis 0 0 1": ["axis"],
    "ros twin_arm --robot dynamixel --seed 3": ["seed"],
    "run --target 0.1 0 0.5 --pace 0.5": ["pace"],
    "run circle --strategy lstm --recipe paper": ["recipe"],
    "run circle --session none": ["session"],
    "run circle --weights shipped --session mine.session.json": ["session"],
    "session some.safetensors --recording some.episodes --robot dynamixel "
    "--robot-option a=1 --tracking udp:9763 --fidelity accurate --seconds 20 --seed 2": [
        "robot",
        "robot_option",
        "tracking",
        "fidelity",
        "seconds",
        "seed",
    ],
    "live --robot dynamixel --seed 3": ["seed"],
    "emulate servos --mocap-rate 60 --mocap-latency 0.1 --mocap-noise 0.1": [
        "mocap_rate",
        "mocap_latency",
        "mocap_noise",
    ],
    "emulate servos --pose-rate 50": ["pose_rate"],
    "emulate mocap --protocol udp --host 0.0.0.0": ["host"],
    "emulate mocap --protocol qualisys --poses-to 127.0.0.1:9": ["poses_to"],
    "emulate mocap --port 9": ["port"],
    "emulate mocap --protocol udp --command-port 9": ["command_port"],
    "emulate mocap --protocol udp --data-port 9": ["data_port"],
    "emulate mocap --protocol udp --multicast 239.255.42.99": ["multicast"],
    "tracking calibrate-camera --source . --views 3 --resolution 64 48": [
        "views",
        "resolution",
    ],
    "tracking calibrate-camera --print-board --source 1": ["source"],
    "tracking calibrate-camera --print-board --views 3": ["views"],
    "tracking calibrate-camera --paper a3": ["paper"],
}
"""Command lines, each with the parameters that would have no effect there."""


def commands(
    name: str = "", target: SubcommandApp | Callable = app
) -> Iterator[tuple[str, Callable]]:
    """All commands that can be run, by their words."""
    if not isinstance(target, SubcommandApp):
        yield name, target
        return
    for child, entry in target._subcommands.items():
        words = f"{name} {child.replace('_', '-')}".strip()
        yield from commands(words, entry.target)


COMMANDS = dict(commands())


def read_names(function: Callable) -> set[str]:
    """Names that the body of a function reads."""
    source = textwrap.dedent(inspect.getsource(function))
    nodes = ast.walk(ast.parse(source))
    names = (node for node in nodes if isinstance(node, ast.Name))
    return {node.id for node in names if isinstance(node.ctx, ast.Load)}


def command_of(line: str) -> str:
    return max((name for name in COMMANDS if line.startswith(name)), key=len)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_read_by_its_command(name):
    function = inspect.unwrap(COMMANDS[name])
    assert set(inspect.signature(function).parameters) <= read_names(function)


@pytest.mark.parametrize("line", REFUSED)
def test_an_option_without_effect_is_refused(line, tmp_path, monkeypatch, refusal):
    monkeypatch.chdir(tmp_path)
    message = refusal(*line.split())
    assert "would have no effect" in message
    for option in REFUSED[line]:
        assert f"--{option.replace('_', '-')}" in message
    assert not list(tmp_path.iterdir())


def test_every_condition_of_every_command_is_tried():
    declared = {
        (name, option)
        for name, function in COMMANDS.items()
        for condition in conditions_of(function)
        for option in condition.options
    }
    tried = set()
    for line, options in REFUSED.items():
        tried |= {(command_of(line), option) for option in options}
    assert tried == declared


def test_an_option_has_its_effect_beside_what_it_needs():
    done = []

    @beside("search", "out")
    def command(search: int = 0, out: str | None = None) -> None:
        done.append((search, out))

    command()
    command(search=3, out="arm.toml")
    with pytest.raises(S2C2AError, match="it has one with --search alone"):
        command(out="arm.toml")
    assert done == [(0, None), (3, "arm.toml")]


@pytest.mark.parametrize("command", ["collect --out x.episodes", "run circle"])
@pytest.mark.parametrize("parallel", ["--cluster local", "PARALLEL 2"])
def test_a_real_arm_is_not_driven_in_parallel(command, parallel, refusal):
    option = "--threads" if command.startswith("collect") else "--jobs"
    line = f"{command} --robot dynamixel {parallel.replace('PARALLEL', option)}"
    assert f"leave out {option} and --cluster" in refusal(*line.split())


def test_a_simulated_arm_is_driven_in_parallel():
    check_parallel(RobotFactory(), 4, "local")
    check_parallel(RobotFactory("dynamixel"), 1, None)


def test_a_table_refuses_a_strategy_that_ignores_its_guard(tmp_path, refusal):
    for table in ("obstacles", "all"):
        command = ["reproduce", table, "--strategy", "lstm", "--out", str(tmp_path)]
        message = refusal(*command)
        assert "--strategy lstm cannot be compared in table 'obstacles'" in message
