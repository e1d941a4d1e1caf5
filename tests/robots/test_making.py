"""Bodies by name: those of the package, in a file of one's own, and what is said where there is none."""

import pickle
from functools import partial

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.robots import RobotFactory, options_from
from s2c2a.robots.factory import robot_class
from s2c2a.robots.simulation import SimulatedRobot

OWN = """
from typing import TYPE_CHECKING, Literal

from s2c2a.robots import Robot
from s2c2a.robots.simulation import SimulatedRobot

if TYPE_CHECKING:
    from nowhere import Nothing


class CustomComponent(SimulatedRobot):
    def __init__(self, arm, port: str = "/dev/null", baud: int = 9600, slow: bool = False, gain: float = 1.0,
                 grip: Literal["soft", "hard"] = "soft", anything=None, seed: int = 0):
        super().__init__(arm, seed=seed)
        self.given = port, baud, slow, gain, grip, anything, seed


class Needy(SimulatedRobot):
    def __init__(self, arm, port: str, baud: int = 9600):
        super().__init__(arm)


class Odd(SimulatedRobot):
    def __init__(self, arm, what: "Nothing" = None, where: object() = None):
        super().__init__(arm)


class Half(Robot):
    def open(self):
        pass


class Refusing(SimulatedRobot):
    def __init__(self, arm):
        raise ValueError("no motors on this bus")


def maker(arm):
    return CustomComponent(arm)


number = 7
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The beginning of names in that file."""
    path = tmp_path / f"bodies_{tmp_path.name}.py"
    path.write_text(OWN)
    monkeypatch.setattr("sys.path", [str(tmp_path), *__import__("sys").path])
    return f"{path}:"


def test_the_packages_own_body_is_found_by_its_short_name():
    assert robot_class("sim") is SimulatedRobot
    assert RobotFactory().simulated
    assert (str(RobotFactory()), str(RobotFactory.simulation())) == (
        "sim",
        "sim fidelity=fast",
    )


def test_a_body_in_a_file_is_made_with_the_options_in_the_kinds_that_it_asks_for(
    own, twin
):
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


def test_what_is_offered_is_given_where_it_is_taken_and_what_was_chosen_counts_more(
    own, twin
):
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
}


@pytest.mark.parametrize(("name", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_made_is_refused_in_words(own, twin, name, options, said):
    with pytest.raises(S2C2AError, match=said):
        RobotFactory(f"{own}{name}", tuple(options.items())).make(twin)


def test_options_whose_kind_cannot_be_told_are_given_as_they_were_written(own, twin):
    assert (
        RobotFactory(f"{own}Odd", (("what", "3"), ("where", "4"))).make(twin).arm
        is twin
    )


def test_what_a_body_raises_itself_is_not_hidden(own, twin):
    with pytest.raises(
        S2C2AError, match="Refusing cannot be made: ValueError: no motors on this bus"
    ):
        RobotFactory(f"{own}Refusing", ()).make(twin)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "twin",
            r"no robot 'twin'; choose one of sim, or give your own as module:Name or file.py:Name",
        ),
        ("nowhere_at_all:Arm", "cannot be loaded: ModuleNotFoundError"),
        ("nowhere.py:Arm", "there is no file nowhere.py"),
        (":", "cannot be loaded"),
        ("", "no robot ''"),
    ],
)
def test_a_name_that_stands_for_nothing_is_told(name, said):
    with pytest.raises(S2C2AError, match=said):
        robot_class(name)


def test_a_file_that_cannot_be_imported_is_told_with_what_it_raised(tmp_path):
    (tmp_path / "broken_body.py").write_text("1 / 0")
    with pytest.raises(S2C2AError, match="ZeroDivisionError: division by zero"):
        robot_class(f"{tmp_path}/broken_body.py:Arm")


def test_a_body_of_another_package_is_found_by_its_entry_point(monkeypatch):
    class Point:
        name = "theirs"

        def load(self):
            return SimulatedRobot

    def points(group, name):
        return [Point()] if (group, name) == ("s2c2a.robots", "theirs") else []

    monkeypatch.setattr("s2c2a.plugins.entry_points", points)
    assert robot_class("theirs") is SimulatedRobot
    with pytest.raises(S2C2AError, match="no robot 'others'"):
        robot_class("others")


def test_an_entry_point_that_fails_is_told_by_its_name(monkeypatch):
    class Point:
        def load(self):
            raise ImportError("libmotor.so is missing")

    monkeypatch.setattr("s2c2a.plugins.entry_points", lambda group, name: [Point()])
    with pytest.raises(
        S2C2AError,
        match=r"the robot 'theirs' cannot be loaded: ImportError: libmotor\.so is missing",
    ):
        robot_class("theirs")


def test_options_are_read_as_a_user_writes_them():
    given = options_from(["port=/dev/ttyUSB0", "note=a=b", "empty="])
    assert given == (("port", "/dev/ttyUSB0"), ("note", "a=b"), ("empty", ""))
    assert options_from([]) == ()


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["port"], "'port' is not a robot option"),
        (["a=1", "a=2"], "appears twice"),
        (["=3"], "'=3' is not a robot option"),
    ],
)
def test_options_that_are_none_are_refused(texts, said):
    with pytest.raises(S2C2AError, match=said):
        options_from(texts)


def test_a_body_travels_to_other_processes(twin):
    make = pickle.loads(
        pickle.dumps(partial(RobotFactory.simulation().make, twin, seed=3))
    )
    with make() as one, SimulatedRobot(twin, seed=3) as other:
        np.testing.assert_array_equal(one.read()["cables"], other.read()["cables"])
