"""The control loop alone moves arms, and pages quote the code as it is."""

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

from s2c2a.planning import Outcome
from s2c2a.runtime import Loop

DOCS = Path(__file__).parents[1] / "docs"
SOURCE = Path(__file__).parents[1] / "src" / "s2c2a"
SENDERS = {
    "runtime/loop.py:_send": "the control loop",
    "runtime/conformance.py:_attempt": "invalid commands of a resting arm, which the "
    "loop never sends; the loop sends all others",
    "robots/simulation/simulated_robot.py:step": "a simulation by itself, for physics "
    "without a control loop",
}
"""Functions that call `Robot.send`, and why."""
TRANSPORTS = {
    "live/process.py": {"self._pipe", "pipe"},
    "live/gate.py": {"viser", "browser"},
    "lab/emulation/qtm.py": {"client.socket"},
}
"""Pipes and sockets, which have a method of the same name."""


def _senders(tree: ast.AST, function: str = "") -> Iterator[tuple[str, str]]:
    """Yield every mention of a method `send`: the function around it, and the object."""
    for node in ast.iter_child_nodes(tree):
        inner = function
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            inner = node.name
        if isinstance(node, ast.Attribute) and node.attr == "send":
            yield inner, ast.unparse(node.value)
        if isinstance(node, ast.Call) and any(
            isinstance(argument, ast.Constant) and argument.value == "send"
            for argument in node.args[1:2]
            if ast.unparse(node.func) == "getattr"
        ):
            yield inner, ast.unparse(node)
        yield from _senders(node, inner)


def _foreign_senders(name: str, tree: ast.AST) -> list[str]:
    """Places in a file that move a robot beside the control loop."""
    return [
        f"{name}:{function}"
        for function, thing in _senders(tree)
        # a robot around another one delegates
        if function != "send"
        and f"{name}:{function}" not in SENDERS
        and thing not in TRANSPORTS.get(name, ())
    ]


def test_nobody_but_the_control_loop_sends_commands_to_robots():
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found += _foreign_senders(path.relative_to(SOURCE).as_posix(), tree)
    assert not found, (
        f"{', '.join(found)} call `Robot.send`: play the motion on `runtime.Loop` "
        "(`runtime.Player`), which limits commands and obeys the emergency stop"
    )


def test_every_exception_from_that_is_in_use():
    places = set()
    for path in SOURCE.rglob("*.py"):
        name = path.relative_to(SOURCE).as_posix()
        tree = ast.parse(path.read_text(encoding="utf-8"))
        places |= {f"{name}:{function}" for function, _ in _senders(tree)}
        places |= {name for _ in _senders(tree)}
    assert places >= SENDERS.keys() | TRANSPORTS.keys()


def test_a_player_that_sends_by_itself_is_found():
    text = "class Motion:\n    def go(self):\n        self._robot.send(rest)\n"
    assert _foreign_senders("own.py", ast.parse(text)) == ["own.py:go"]
    text = "def go(robot):\n    getattr(robot, 'send')(rest)\n"
    assert _foreign_senders("own.py", ast.parse(text)) == ["own.py:go"]


def test_the_control_step_on_the_page_is_the_one_in_the_code():
    page = (DOCS / "contribute" / "architecture.md").read_text(encoding="utf-8")
    assert inspect.getsource(Loop._control_step) in page


def test_every_planner_outcome_stands_on_the_page():
    page = (DOCS / "concepts" / "planning.md").read_text(encoding="utf-8")
    for outcome in Outcome:
        assert f"| {outcome.value} | `{outcome.name}` | " in page
