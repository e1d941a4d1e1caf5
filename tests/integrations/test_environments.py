"""Environments keep the interface of Gymnasium, on arms of all kinds."""

import re
import runpy
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import s2c2a
from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.arm.randomized import randomized_arm
from s2c2a.errors import S2C2AError
from s2c2a.integrations.environments import simulation
from s2c2a.integrations.environments.jacobian_policy import JacobianPolicy
from s2c2a.integrations.environments.simulation import DIVERGED, SimulationBatch
from s2c2a.integrations.environments.spaces import Controls, observation_parts
from s2c2a.integrations.environments.tasks import FAMILIES, Avoid, Reach
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime.limits import CommandLimiter, CommandLimits

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import s2c2a.integrations.environments  # noqa: E402  # registers them

from marks import slow_after  # noqa: E402

ARMS = ("twin_arm", "simulated_arm", "pneumatic_arm", "planar_finger", "spiral_arm")
FINGER = load_arm("planar_finger")
EXAMPLES = Path(__file__).parents[2] / "examples" / "extending"


def generators(count, first=0):
    return [np.random.default_rng(first + number) for number in range(count)]


def begun(task="Reach", arm=FINGER, count=1, **options):
    batch = SimulationBatch(task, arm, count, **options)
    batch.reset(range(count), generators(count), new_robots=True)
    return batch


@pytest.mark.parametrize("arm", slow_after(1, ARMS))
def test_the_checker_of_gymnasium_finds_nothing(arm):
    environment = gymnasium.make("S2C2A/Avoid-v0", arm=arm, seconds=2.0).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(environment, skip_render_check=True)


@pytest.mark.parametrize("task", slow_after(2, FAMILIES))
def test_every_task_runs_until_its_time_is_over(task):
    environment = gymnasium.make(f"S2C2A/{task}-v0", arm=FINGER, seconds=1.0)
    environment.reset(seed=3)
    action = np.ones(environment.action_space.shape, np.float32)
    results = [environment.step(action) for _ in range(10)]
    assert [truncated for _, _, _, truncated, _ in results] == [False] * 9 + [True]
    assert all(np.isfinite(reward) for _, reward, *_ in results)
    assert results[-1][-1]["error"] > 0.0


def test_arms_in_a_batch_are_as_single_ones():
    many = gymnasium.make_vec("S2C2A/Reach-v0", num_envs=3, arm="twin_arm", seconds=0.5)
    observations = [many.reset(seed=5)[0]]
    with pytest.raises(S2C2AError, match="give one for each"):
        many.reset(seed=[5, 6, 7, 8, 9])
    with pytest.raises(S2C2AError, match="a reset has no options, and goal was given"):
        many.reset(options={"goal": [0.0, 0.0, 0.5]})
    actions = np.random.default_rng(0).uniform(-1, 1, (5, *many.action_space.shape))
    for action in actions.astype(np.float32):
        observations.append(many.step(action)[0])
    one = gymnasium.make("S2C2A/Reach-v0", arm="twin_arm", seconds=0.5)
    alone = [one.reset(seed=7)[0]]
    for action in actions.astype(np.float32):
        alone.append(one.step(action[2])[0])
    np.testing.assert_array_equal(np.array(observations)[:, 2], alone)


def test_a_seed_repeats_an_episode_also_after_others():
    environment = gymnasium.make("S2C2A/Hold-v0", arm=FINGER, randomization=1.0)
    action = np.ones(environment.action_space.shape, np.float32)
    seen = []
    for _ in range(2):
        environment.reset(seed=11)
        seen.append(environment.step(action)[0])
        environment.reset()
    np.testing.assert_array_equal(*seen)


def test_randomized_arms_differ_between_episodes():
    batch = begun(randomization=1.0)
    first = batch.states(0).copy()
    batch.reset([0], generators(1, 9), new_robots=False)
    assert np.abs(batch.states(0) - first).max() > 1e-4


@pytest.mark.parametrize(("arm", "count"), [("planar_finger", 2), ("twin_arm", 6)])
def test_controls_are_the_bends_that_cables_command(arm, count):
    controls = Controls.of(load_arm(arm))
    assert controls.count == count
    bends = np.linspace(-0.3, 0.3, count)
    np.testing.assert_allclose(controls.bends(controls.commands(bends)), bends)


def test_the_next_episode_begins_in_the_step_after_the_last():
    many = gymnasium.make_vec("S2C2A/Reach-v0", num_envs=2, arm=FINGER, seconds=0.3)
    many.reset(seed=0)
    action = np.ones(many.action_space.shape, np.float32)
    truncated = [many.step(action) for _ in range(5)]
    assert [bool(result[3].all()) for result in truncated] == [0, 0, 1, 0, 0]
    _, rewards, _, _, info = truncated[3]
    assert (rewards == 0.0).all()
    assert not info["_error"].any()
    parts = observation_parts(Controls.of(FINGER))
    assert (truncated[3][0][:, parts["last_action"]] == 0.0).all()


def test_an_arm_in_the_sphere_costs_reward():
    family = Avoid(Controls.of(FINGER), 10)
    states = np.array([[[0, 0, 0.06, 0, 0, 1], [0, 0, 0.11, 0, 0, 1]]], float)
    met = replace(begun().moment(), states=states, goals=states[:, -1, :3])
    inside, outside = np.array([[0, 0, 0.08, 0.01]]), np.array([[1.0, 0, 0, 0.01]])
    assert family.rewards(replace(met, obstacles=outside)) == 0.0
    assert family.rewards(replace(met, obstacles=inside)) < -5.0


def test_a_goal_that_is_met_has_no_cost_and_effort_has():
    family = FAMILIES["Reach"](Controls.of(FINGER), 10)
    moment = begun().moment()
    goals = moment.tips + np.array([0.011, 0.0, 0.0])
    moment = replace(moment, goals=goals, actions=np.ones((1, 2)))
    np.testing.assert_allclose(family.rewards(moment), -10 * 0.011 / 0.11 - 0.1)


def twins(batch, count, randomization):
    """Robots as those of a batch that `begun` began."""
    robots = []
    for random in generators(count):
        seed = int(random.integers(2**31))
        arm = batch.arm
        if randomization:
            arm = randomized_arm(arm, seed, randomization)
        robots.append(SimulatedRobot(arm, batch._fidelity, seed))
        robots[-1].open()
        robots[-1].measure_cables()
    return robots


@pytest.mark.parametrize("randomization", [0.0, 1.0])
@pytest.mark.parametrize(
    ("arm", "fidelity"),
    slow_after(2, [*((arm, "fast") for arm in ARMS), ("twin_arm", "accurate")]),
)
def test_arms_that_advance_together_are_as_robots_alone_with_limited_commands(
    arm, fidelity, randomization
):
    options = {"randomization": randomization, "fidelity": fidelity, "seconds": 4.0}
    batch = begun("Hold", arm, 2, **options)
    robots = twins(batch, 2, randomization)
    controls, step_limit = batch.controls, ArmGeometry.of(batch.arm).step_limit
    limiters = [CommandLimiter(CommandLimits.of(batch.arm)) for _ in robots]
    random = np.random.default_rng(4)
    for step in range(6):
        actions = random.uniform(-1, 1, (2, controls.count))
        batch.step(actions)
        for number, robot in enumerate(robots):
            limiter = limiters[number]
            bends = controls.bends(limiter.command) + actions[number] * step_limit
            robot.apply_force(batch._forces[number, step])
            robot.step(limiter.limit(controls.commands(bends)))
            np.testing.assert_array_equal(batch.states(number), robot.states())
            cables = robot.measure_cables()
            np.testing.assert_array_equal(batch._cables[number], cables)


def test_a_simulation_that_diverges_ends_its_episode_alone():
    batch, undisturbed = begun(count=3), begun(count=3)
    before = batch.states(1).copy()
    batch._robots[1].data.qvel[:] = 1e12
    for _ in range(2):
        outcome = batch.step(np.zeros((3, 2)))
        expected = undisturbed.step(np.zeros((3, 2)))
        assert outcome.terminated.tolist() == [False, True, False]
        assert outcome.rewards[1] == DIVERGED
        assert np.isfinite(outcome.observations).all()
        np.testing.assert_array_equal(batch.states(1), before)
        np.testing.assert_array_equal(
            outcome.observations[::2], expected.observations[::2]
        )
    batch.reset([1], generators(1), new_robots=False)
    assert not batch.step(np.zeros((3, 2))).terminated.any()


def test_arms_without_a_seed_are_different_robots():
    many = gymnasium.make_vec("S2C2A/Reach-v0", num_envs=2, arm=FINGER, seconds=0.5)
    many.reset()
    first, second = (many.unwrapped.batch._robots[number] for number in range(2))
    assert first is not second


def test_a_step_before_the_first_reset_is_refused():
    with pytest.raises(S2C2AError, match="reset"):
        SimulationBatch("Reach", FINGER).step(np.zeros((1, 2)))


def test_forces_push_an_arm_that_holds_still():
    batch = begun("Hold", seconds=4.0)
    errors = [batch.step(np.zeros((1, 2))).errors[0] for _ in range(40)]
    assert max(errors) > 1e-3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": "Reech"}, "did you mean"),
        ({"count": 0}, "1 or more"),
        ({"seconds": float("nan")}, "control steps"),
        ({"seconds": 1e9}, "control steps"),
        ({"randomization": 3.0}, "strength"),
        ({"arm": "no_arm"}, "preset"),
    ],
)
def test_wrong_options_are_explained(options, message):
    with pytest.raises(S2C2AError, match=message):
        begun(**options)


def test_a_fork_of_a_process_that_used_environments_says_what_to_do(monkeypatch):
    monkeypatch.setattr(simulation, "USED_BY", {1})
    environment = gymnasium.make("S2C2A/Reach-v0", arm=FINGER)
    with pytest.raises(S2C2AError, match=r'vector_kwargs=\{"context": "spawn"\}'):
        environment.reset()


def test_a_picture_shows_the_arm():
    environment = gymnasium.make("S2C2A/Avoid-v0", arm=FINGER, render_mode="rgb_array")
    environment.reset(seed=0)
    picture = environment.render()
    assert picture.shape == (320, 320, 3)
    assert picture.std() > 1.0


def test_noise_of_a_sensor_reaches_the_observation():
    noisy = FINGER.model_copy(
        update={"motor": FINGER.motor.model_copy(update={"noise_ticks": 50.0})}
    )
    batch = begun(arm=noisy)
    part = observation_parts(batch.controls)["bends"]
    first = batch.step(np.zeros((1, 2))).observations[0, part]
    second = batch.step(np.zeros((1, 2))).observations[0, part]
    assert (first != second).any()


def jacobian_actions(bends, **parts):
    """Actions of the policy of twin_arm in one moment, and motions of its tip [m]."""
    controls = Controls.of(load_arm("twin_arm"))
    policy = JacobianPolicy(controls)
    places = observation_parts(controls)
    observation = np.zeros((1, max(place.stop for place in places.values())))
    for name, values in {"commanded_bends": bends, **parts}.items():
        observation[0, places[name]] = values
    (actions,) = policy.actions(observation)
    jacobian = np.asarray(policy._jacobians(np.float32(bends)[None])[0])
    return actions, jacobian @ actions * controls.geometry.step_limit


def test_the_jacobian_policy_leads_bends_that_do_not_move_the_tip_back():
    bends = np.array([0.7, 0.1, 0.2, -0.6, 0.6, 0.3])
    actions, motion = jacobian_actions(bends)
    assert actions @ bends < -0.01
    np.testing.assert_allclose(motion, 0.0, atol=1e-4)


def test_the_jacobian_policy_moves_with_its_goal():
    bends = np.array([0.3, 0.1, 0.2, 0.1, 0.1, 0.0])
    _, at_rest = jacobian_actions(bends)
    _, motion = jacobian_actions(bends, goal_change=[0.0, 0.1, 0.0])
    assert (motion - at_rest)[1] > 0.1 * 0.1 * 0.6 / 3


@pytest.mark.parametrize(
    ("name", "meant"),
    [("reward", "rewards"), ("observation", "observe"), ("end", "ends")],
)
def test_a_task_with_a_misspelled_method_is_refused(name, meant):
    with pytest.raises(
        S2C2AError, match=rf"'{name}' \(did you mean {meant}\?\); .*ends"
    ):
        type("Mine", (Reach,), {name: lambda self, moment: 0})


def test_a_task_may_have_helpers_and_those_of_its_base():
    def helper(self, moment):
        return 0

    type("Mine", (Reach,), {"_reward": helper, "distances": helper})
    type("Mine", (Reach,), {"rewards": helper, "reward": helper})
    type("Mine", (Avoid,), {"depths": helper})


class Own(Reach):
    """A task in which every part differs."""

    def goals(self, random, tip):
        return np.tile(tip + np.array([0.01, 0.0, 0.0]), (self.steps + 2, 1))

    def sampled_arm(self, seed):
        modules = [module.model_copy(update=SOFTER) for module in self.arm.modules]
        return self.arm.model_copy(update={"modules": tuple(modules)})

    def observe(self, moment):
        return {**super().observe(moment), "steps": moment.steps[:, None]}

    def rewards(self, moment):
        return 10.0 * moment.steps - self.ends(moment)

    def ends(self, moment):
        return moment.steps == 3


SOFTER = {"bending_stiffness": 0.5 * FINGER.modules[0].bending_stiffness}


@pytest.mark.parametrize(
    ("methods", "told"),
    [
        (
            {"goals": lambda task, random, tip: np.tile(tip, (10, 1))},
            "(steps + 2, 3), here (12, 3); got shape (10, 3)",
        ),
        (
            {"goals": lambda task, random, tip: np.full((12, 3), np.nan)},
            "(steps + 2, 3), here (12, 3); got [[nan nan nan]",
        ),
        (
            {"observe": lambda task, moment: {"steps": moment.steps}},
            "'steps': give finite numbers of shape (batch, values), here (2, 1)",
        ),
        (
            # a column, which NumPy would make a square
            {"rewards": lambda task, moment: np.zeros((len(moment.steps), 1))},
            "rewards: give finite numbers of shape (batch,), here (2,)",
        ),
        (
            {"sampled_arm": lambda task, seed: load_arm("twin_arm")},
            "numbers of its modules alone",
        ),
    ],
)
def test_a_task_with_values_of_another_form_is_refused(methods, told):
    task = type("Wrong", (Reach,), methods)
    options = {"seconds": 1.0, "randomization": 1.0}
    with pytest.raises(S2C2AError, match=re.escape(told)):
        begun(task, count=2, **options).step(np.zeros((2, 2)))


def test_without_randomization_a_task_samples_no_arm():
    other = {"sampled_arm": lambda task, seed: load_arm("twin_arm")}
    assert begun(type("Other", (Reach,), other)).moment().steps == 0


def test_a_task_without_a_class_is_explained():
    with pytest.raises(S2C2AError, match="or give a class of your own with task=Mine"):
        gymnasium.make_vec("S2C2A/Task-v0", 2, "vector_entry_point")


def test_a_task_of_ones_own_decides_every_part_of_one_arm_and_of_many():
    options = {"task": Own, "arm": FINGER, "randomization": 1.0, "seconds": 9.0}
    many = gymnasium.make_vec("S2C2A/Task-v0", 2, "vector_entry_point", **options)
    one = gymnasium.make("S2C2A/Task-v0", disable_env_checker=True, **options)
    many.reset(seed=0)
    one.reset(seed=0)
    for step, reward in ((1, 10.0), (2, 20.0), (3, 29.0)):
        seen, rewards, ended, *_ = many.step(np.zeros(many.action_space.shape))
        alone = one.step(np.zeros(one.action_space.shape))
        assert rewards.tolist() == [reward, reward] == [alone[1]] * 2
        assert ended.tolist() == [step == 3] * 2
        assert alone[2] == (step == 3)
        np.testing.assert_array_equal(seen[:, -1], [step, step])
        np.testing.assert_array_equal(seen[0], alone[0])
    np.testing.assert_allclose(alone[4]["error"], 0.01, rtol=0.2)
    modules = one.unwrapped.batch._robots[0].arm.modules
    assert [m.bending_stiffness for m in modules] == [*SOFTER.values()] * len(modules)


def test_the_example_learns_and_writes_a_strategy(tmp_path, capsys):
    example = runpy.run_path(str(EXAMPLES / "own_learning.py"))
    example["main"](tmp_path / "cup.safetensors", generations=6, arms=8)
    before, after = re.findall(r"-[0-9.]+", capsys.readouterr().out)
    assert float(after) > float(before)
    assert s2c2a.load_strategy(tmp_path / "cup.safetensors").arm == FINGER
