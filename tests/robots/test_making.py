"""Robot classes by name: in the package, in a user's file, and unknown ones."""

import pickle
from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.plugins.options import options_from
from s2c2a.robots import RobotFactory
from s2c2a.robots.factory import robot_class
from s2c2a.robots.simulation import SimulatedRobot

OWN = """
from typing import TYPE_CHECKING, Literal

from s2c2a.robots import Robot
from s2c2a.robots.simulation import SimulatedRobot

if TYPE_CHECKING:
    from nowhere import Nothing


class Own(SimulatedRobot):
    def __init__(self, arm, port: str = "/dev/null", baud: int = 9600,
                 slow: bool = False, gain: float = 1.0,
                 grip: Literal["soft", "hard"] = "soft", anything=None, seed: int = 0):
        super().__init__(arm, seed=seed)
        self.given = port, baud, slow, gain, grip, anything, seed


class Needy(SimulatedRobot):
    def __init__(self, arm, port: str, baud: int = 9600):
        super().__init__(arm)


class Odd(SimulatedRobot):
    def __init__(self, arm, what: "Nothing" = None, where: object() = None):
        super().__init__(arm)


class Bare(SimulatedRobot):
    def __init__(self, arm, gain=1, slow=False, port=None):
        super().__init__(arm)
        self.given = gain, slow, port
        if port:
            open_port = port + 1


class Half(Robot):
    def open(self):
        pass


class Refusing(SimulatedRobot):
    def __init__(self, arm):
        raise ValueError("no motors on this bus")


def maker(arm):
    return Own(arm)


number = 7
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Return the prefix of class names in a file of robots."""
    path = tmp_path / f"robots_{tmp_path.name}.py"
    path.write_text(OWN)
    monkeypatch.setattr("sys.path", [str(tmp_path), *__import__("sys").path])
    return f"{path}:"


def test_the_simulated_robot_has_a_short_name():
    assert robot_class("sim") is SimulatedRobot
    assert RobotFactory().simulated
    assert (str(RobotFactory()), str(RobotFactory.simulation())) == (
        "sim",
        "sim fidelity=fast",
    )


def test_options_of_a_robot_in_a_file_are_converted_to_their_types(own, twin):
    options = {
        "port": "/dev/ttyUSB0",
        "baud": "115200",
        "slow": "yes",
        "gain": "2.5",
        "grip": "hard",
        "anything": "x",
    }
    robot = RobotFactory(f"{own}Own", tuple(options.items())).make(twin)
    assert robot.given == ("/dev/ttyUSB0", 115200, True, 2.5, "hard", "x", 0)
    assert robot.arm is twin


def test_defaults_apply_if_accepted_and_options_override_them(own, twin):
    assert (
        RobotFactory(f"{own}Own", ()).make(twin, seed=5, temperature=3).given[-1] == 5
    )
    assert RobotFactory(f"{own}Own", (("seed", "9"),)).make(twin, seed=5).given[-1] == 9
    assert RobotFactory(f"{own}Needy", (("port", "a"),)).make(twin, seed=5).arm is twin


REFUSED = {
    "an option that it does not take": (
        "Own",
        {"color": "red"},
        r"Own has no option 'color'; it has port, baud",
    ),
    "a word for a number": (
        "Own",
        {"baud": "fast"},
        r"option baud=fast of Own: write a whole number",
    ),
    "another word than those": (
        "Own",
        {"grip": "firm"},
        r"option grip=firm of Own: .*'soft' or 'hard'",
    ),
    "no number": ("Own", {"gain": "much"}, r"option gain=much of Own: .*number"),
    "one that it cannot do without": (
        "Needy",
        {},
        r"Needy needs port; add --robot-option port=...",
    ),
    "the arm by its name": ("Own", {"arm": "x"}, r"has no option 'arm'"),
    "half a robot": (
        "Half",
        {},
        r"Half is not a complete robot: it lacks close, read, send, sensors",
    ),
    "a function": ("maker", {}, r"not a robot; give a subclass of s2c2a.robots.Robot"),
    "a number": ("number", {}, r"is 7, not a robot"),
    "nothing of that name": ("Nobody", {}, r"cannot be loaded: AttributeError"),
    "no number, as the default is": (
        "Bare",
        {"gain": "much"},
        r"option gain=much of Bare: .*number",
    ),
    "text that its class takes for a number": (
        "Bare",
        {"port": "9"},
        r"Bare cannot be made: TypeError: .*text was given for port",
    ),
    "a class that fails": (
        "Refusing",
        {},
        "Refusing cannot be made: ValueError: no motors on this bus",
    ),
}


@pytest.mark.parametrize(("name", "options", "message"), REFUSED.values(), ids=REFUSED)
def test_invalid_robots_and_options_are_rejected_with_a_message(
    own, twin, name, options, message
):
    with pytest.raises(S2C2AError, match=message):
        RobotFactory(f"{own}{name}", tuple(options.items())).make(twin)


def test_options_without_a_known_type_stay_text(own, twin):
    options = (("what", "3"), ("where", "4"))
    assert RobotFactory(f"{own}Odd", options).make(twin).arm is twin


def test_options_without_annotation_have_the_type_of_a_numeric_default(own, twin):
    options = (("gain", "2.5"), ("slow", "yes"))
    assert RobotFactory(f"{own}Bare", options).make(twin).given == (2.5, True, None)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "twin",
            "no robot 'twin'; choose one of dynamixel, feetech, sim, "
            "or give your own as module:Name or file.py:Name",
        ),
        ("nowhere_at_all:Arm", "cannot be loaded: ModuleNotFoundError"),
        ("nowhere.py:Arm", "there is no file nowhere.py"),
        (":", "cannot be loaded"),
        ("", "no robot ''"),
    ],
)
def test_an_unknown_name_is_rejected(name, message):
    with pytest.raises(S2C2AError, match=message):
        robot_class(name)


def test_a_file_that_cannot_be_imported_is_reported_with_its_error(tmp_path):
    (tmp_path / "broken_body.py").write_text("1 / 0")
    with pytest.raises(S2C2AError, match="ZeroDivisionError: division by zero"):
        robot_class(f"{tmp_path}/broken_body.py:Arm")


@pytest.fixture
def theirs(monkeypatch):
    """An entry point of another package, `theirs`, which loads the simulated robot."""
    point = Mock(load=lambda: SimulatedRobot)

    def points(group, name=""):
        return [point] if (group, name) == ("s2c2a.robots", "theirs") else []

    monkeypatch.setattr("s2c2a.plugins.discovery.entry_points", points)
    return point


@pytest.mark.usefixtures("theirs")
def test_a_robot_of_another_package_is_found_by_its_entry_point():
    assert robot_class("theirs") is SimulatedRobot
    with pytest.raises(S2C2AError, match="no robot 'others'"):
        robot_class("others")


def test_a_failing_entry_point_is_reported_by_name(theirs):
    theirs.load = Mock(side_effect=ImportError("libmotor.so is missing"))
    expected = r"robot 'theirs' cannot be loaded: ImportError: libmotor\.so is missing"
    with pytest.raises(S2C2AError, match=f"the {expected}"):
        robot_class("theirs")


def test_options_are_parsed_from_key_value_texts():
    given = options_from(["port=/dev/ttyUSB0", "note=a=b", "empty="])
    assert given == (("port", "/dev/ttyUSB0"), ("note", "a=b"), ("empty", ""))
    assert options_from([]) == ()


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["port"], "'port' is not an option"),
        (["a=1", "a=2"], "appears twice"),
        (["=3"], "'=3' is not an option"),
    ],
)
def test_invalid_option_texts_are_rejected(texts, message):
    with pytest.raises(S2C2AError, match=message):
        options_from(texts)


def test_a_robot_factory_can_be_pickled(twin):
    make = pickle.loads(
        pickle.dumps(partial(RobotFactory.simulation().make, twin, seed=3))
    )
    with make() as one, SimulatedRobot(twin, seed=3) as other:
        np.testing.assert_array_equal(one.read()["cables"], other.read()["cables"])
