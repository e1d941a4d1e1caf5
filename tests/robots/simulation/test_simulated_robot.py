"""The simulated robot: clock, seeds, noise, limits, and divergence."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, Cable, arm_to_toml, load_arm
from s2c2a.errors import S2C2AError, SimulationError
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot


def driven(robot, steps=10, seed=0) -> list:
    """Readings of a robot that is opened and driven at random."""
    geometry, random = ArmGeometry.of(robot.arm), np.random.default_rng(seed)
    readings = [robot.open()]
    for _ in range(steps):
        robot.step(random.uniform(geometry.action_low, geometry.action_high))
        readings.append(robot.read())
    return readings


def column(readings, name: str) -> np.ndarray:
    """The time, or what one sensor says, of all readings."""
    return np.array(
        [reading.time if name == "time" else reading[name] for reading in readings]
    )


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("preset", ["twin", "simulated"])
def test_the_same_seed_gives_identical_readings(preset, fidelity, request):
    arm = request.getfixturevalue(preset)
    one, two = (driven(SimulatedRobot(arm, fidelity, seed=5)) for _ in range(2))
    for name in ("time", "cables", "states", "configurations"):
        np.testing.assert_array_equal(column(one, name), column(two, name))


def test_another_seed_changes_the_sensors_and_not_the_physics(twin):
    one, two = (driven(SimulatedRobot(twin, seed=seed)) for seed in (0, 1))
    np.testing.assert_array_equal(column(one, "states"), column(two, "states"))
    assert not np.array_equal(column(one, "cables"), column(two, "cables"))


def test_a_robot_opens_at_rest_with_its_clock_at_zero(twin):
    reading = SimulatedRobot(twin).open()
    assert reading.time == 0.0
    np.testing.assert_allclose(
        reading["states"][:, :3], [[0, 0, 0.2], [0, 0, 0.4], [0, 0, 0.6]], atol=1e-9
    )
    np.testing.assert_allclose(reading["configurations"], [[0, 0, 1]] * 3, atol=1e-9)


@pytest.mark.parametrize("rate", [0.5, 0.7, 3.0, 7.0, 30.0, 333.0])
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_every_control_rate_keeps_its_own_time(make_arm, fidelity, rate):
    """Also where the period is no multiple of the fidelity's time step."""
    arm = make_arm(modules=1, control_rate=rate)
    with SimulatedRobot(arm, fidelity) as robot:
        for _ in range(4):
            robot.step(np.zeros((1, 3)))
        assert robot.read().time == pytest.approx(4 / rate)


@pytest.mark.parametrize("rate", [3.0, 7.0, 33.0])
def test_the_control_rate_changes_nothing_about_where_an_arm_comes_to_rest(
    make_arm, rate
):
    action, ends = 0.01 * np.array([[-1, 0.5, 0.5]] * 2), []
    for hertz in (rate, 10.0):
        with SimulatedRobot(make_arm(modules=2, control_rate=hertz)) as robot:
            for _ in range(int(4 * hertz)):
                robot.step(action)
            ends.append(robot.states())
    np.testing.assert_allclose(*ends, atol=1e-4)


@pytest.mark.parametrize("rate", [0.5, 1.4, 10.0, 50.0])
def test_an_arm_has_settled_for_a_second_when_it_opens(make_arm, rate):
    """A lying module sags under its weight; after opening it moves no more."""
    lying = {"gravity_direction": (1.0, 0.0, 0.0)}
    arm = make_arm(1, 3, {"damping_time": 0.02}, control_rate=rate, **lying)
    robot = SimulatedRobot(arm)
    opened = robot.open()["states"]
    for _ in range(int(np.ceil(2 * rate))):
        robot.step(np.zeros((1, 3)))
    np.testing.assert_allclose(robot.states(), opened, atol=1e-6)


def test_readings_contain_true_configurations_in_module_frames(make_arm):
    """Only the middle module is bent: the last one is straight in its own frame."""
    arm = make_arm(module={"cable": Cable(stiffness=1e5)}, gravity_direction=(0, 0, 0))
    with SimulatedRobot(arm) as robot:
        for _ in range(20):
            robot.step([[0, 0, 0], [-0.012, 0.006, 0.006], [0, 0, 0]])
        reading = robot.read()
    np.testing.assert_allclose(
        reading["configurations"][[0, 2]], [[0, 0, 1]] * 2, atol=1e-3
    )
    assert reading["configurations"][1, 0] > 0.3
    np.testing.assert_allclose(
        reading["states"][2, 3:], reading["configurations"][1], atol=1e-3
    )


@pytest.mark.parametrize("payload", [np.nan, np.inf, -0.1, 51.0])
def test_an_invalid_payload_is_rejected(twin, payload):
    with pytest.raises(S2C2AError, match="payload"):
        SimulatedRobot(twin, payload=payload)


@pytest.mark.parametrize("force", [[0, 0], [np.nan, 0, 0], [[0, 0, 1]], 3.0])
def test_an_invalid_force_is_rejected(twin, force):
    with pytest.raises(S2C2AError, match="a force is three finite"):
        SimulatedRobot(twin).apply_force(force)


@pytest.fixture
def broken(twin, tmp_path, monkeypatch):
    """Return a robot that diverges after three steps, and its last valid states."""
    # MuJoCo writes its warnings to a file in the working folder
    monkeypatch.chdir(tmp_path)
    robot = SimulatedRobot(twin)
    driven(robot, steps=3)
    good = robot.states()
    robot.data.qvel[:] = 1e9
    return robot, good


def test_a_diverged_robot_raises_until_it_is_opened_again(broken):
    robot, good = broken
    with pytest.raises(SimulationError, match=r"twin_arm.*step 4") as caught:
        robot.step(np.zeros((3, 3)))
    assert caught.value.step == 4
    np.testing.assert_array_equal(caught.value.last_states, good)
    for again in (lambda: robot.step(np.zeros((3, 3))), robot.read):
        with pytest.raises(SimulationError) as caught:
            again()
        np.testing.assert_array_equal(caught.value.last_states, good)
    assert np.isfinite(robot.open()["states"]).all()
    robot.step(np.zeros((3, 3)))
    assert np.isfinite(robot.read()["states"]).all()


def test_a_jittered_start_is_straight_except_for_hysteresis(make_arm):
    opened = {}
    for backlash in (0.0, 0.001):
        cable = Cable(stiffness=1e4, backlash=backlash)
        arm = make_arm(2, 3, {"cable": cable, "bending_stiffness": 0.3})
        for seed in (0, 1):
            robot = SimulatedRobot(arm, seed=seed, jitter=0.1)
            opened[backlash, seed] = robot.open()["states"]
            robot.step(np.zeros((2, 3)))
            np.testing.assert_allclose(
                robot.states(), opened[backlash, seed], atol=1e-4
            )
    straight = [[0, 0, 0.2, 0, 0, 1], [0, 0, 0.4, 0, 0, 1]]
    np.testing.assert_allclose(opened[0.0, 0], straight, atol=1e-4)
    assert np.linalg.norm(opened[0.001, 0] - straight) > 1e-3
    assert np.linalg.norm(opened[0.001, 0] - opened[0.001, 1]) > 1e-3


def test_an_arm_too_soft_for_its_cables_raises_an_error(
    make_arm, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    flimsy = {
        "mass": 0.0005,
        "bending_stiffness": 0.0005,
        "damping_time": 0.005,
        "cable": Cable(stiffness=1e6),
    }
    arm = make_arm(20, 8, flimsy, gravity_direction=(0, 0, 0))
    with pytest.raises(SimulationError) as caught:
        driven(SimulatedRobot(arm), steps=30)
    assert caught.value.step >= 1
    assert np.isfinite(caught.value.last_states).all()


def test_a_stiff_light_arm_is_stable(make_arm):
    """Explicit springs are unstable for stiff, light chains."""
    stiff = {"mass": 0.0005, "bending_stiffness": 50.0, "damping_time": 0.005}
    readings = driven(SimulatedRobot(make_arm(6, 4, stiff)), steps=20)
    assert np.isfinite(column(readings, "states")).all()


def test_a_reading_is_a_value_that_later_steps_do_not_change(twin):
    robot = SimulatedRobot(twin)
    reading = robot.open()
    kept = {name: values.copy() for name, values in reading.sensors.items()}
    robot.step(ArmGeometry.of(twin).action_high * np.array([-1, 0.5, 0.5]))
    assert np.abs(robot.read()["states"] - kept["states"]).max() > 0.01
    for name in kept:
        np.testing.assert_array_equal(reading[name], kept[name])


def test_a_new_payload_causes_no_jump(twin):
    robot, loaded = SimulatedRobot(twin), SimulatedRobot(twin, payload=0.1)
    action = np.tile([0.01, -0.005, -0.005], (3, 1))
    robot.open()
    for _ in range(5):
        robot.step(action)
    before = robot.states()
    robot.set_payload(0.1)
    np.testing.assert_allclose(robot.states(), before, atol=1e-9)
    loaded.open()
    for _ in range(60):
        robot.step(action)
        loaded.step(action)
    np.testing.assert_allclose(robot.states(), loaded.states(), atol=0.01)
    with pytest.raises(S2C2AError):
        robot.set_payload(-1.0)


def test_the_twin_moves_and_the_arm_file_describes_it(twin, tmp_path):
    heavy = [
        module.model_copy(update={"mass": 3 * module.mass}) for module in twin.modules
    ]
    (tmp_path / "heavy.toml").write_text(
        arm_to_toml(twin.model_copy(update={"modules": tuple(heavy)}))
    )
    path = str(tmp_path / "heavy.toml")
    robot, alone = SimulatedRobot(twin, twin=path), SimulatedRobot(twin)
    other = SimulatedRobot(load_arm(path))
    assert robot.arm == twin
    quick = twin.model_copy(update={"control_rate": 33.0})
    readings = driven(SimulatedRobot(quick, twin=path))
    assert readings[-1].time == pytest.approx(10 / 33, rel=0.01)
    states = [column(driven(one), "states") for one in (robot, other, alone)]
    np.testing.assert_array_equal(states[0], states[1])
    assert np.abs(states[0] - states[2])[-1].max() > 0.001
    (tmp_path / "short.toml").write_text(
        arm_to_toml(twin.model_copy(update={"modules": tuple(heavy[:2])}))
    )
    with pytest.raises(S2C2AError, match="both must be one arm"):
        SimulatedRobot(twin, twin=str(tmp_path / "short.toml"))
