"""Options that a strategy accepts change what it builds; others are refused."""

import warnings
from dataclasses import dataclass, fields, replace
from types import SimpleNamespace

import jax
import pytest

import s2c2a as s2c2a_package
from s2c2a.arm import load_arm
from s2c2a.errors import ControllerError, S2C2AError, StrategyError
from s2c2a.estimation import EncoderOnly, EstimationSettings, KalmanFilter
from s2c2a.goals import Goal
from s2c2a.jobs import Conditions, jobs_for
from s2c2a.jobs.artifacts import Cache
from s2c2a.live.control import ArmControl, strategies_of
from s2c2a.live.page import LivePage
from s2c2a.live.request import Obstacle
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Loop
from s2c2a.runtime.clock import StepClock
from s2c2a.runtime.driver import StatedDriver
from s2c2a.spaces import Stage
from s2c2a.strategies import (
    STRATEGIES,
    Recipe,
    RunOptions,
    Strategy,
    StrategyOptions,
    pcc,
    recipe_named,
    s2c2a,
    shipped_networks,
    strategy_named,
    strategy_of,
)
from s2c2a.tasks import load_task
from s2c2a.training import Trained

TWIN = load_arm("twin_arm")
BEST = recipe_named("best")
RUNS = {
    "guard": RunOptions("arm"),
    "known_payload": RunOptions(estimation=EstimationSettings(known_payload=0.05)),
    "disturbance_estimation": RunOptions(
        estimation=EstimationSettings(disturbance_estimation=False)
    ),
    "max_compensated_force": RunOptions(
        estimation=EstimationSettings(max_compensated_force=1.0)
    ),
}
"""By option of a run: a run with another value."""
CHANGED = {
    "c2s": replace(BEST.c2s, hidden=16),
    "c2a": replace(BEST.c2a, hidden=16),
    "c2s_fit": replace(BEST.c2s_fit, max_epochs=3),
    "c2a_fit": replace(BEST.c2a_fit, max_epochs=3),
    "history_noise": 0.1,
    "estimator": EncoderOnly(),
    "planner": replace(BEST.planner, engaged_slopes=not BEST.planner.engaged_slopes),
    "babbling": "motor",
    "speeds": (0.02, 0.1),
    "episodes": 9,
    "integral_gain": 0.1,
    "unit_length": not BEST.unit_length,
    "encoders_alone": not BEST.encoders_alone,
}
"""By key of a recipe: another value."""
IN_THE_TASK = {"name", "axis_weights"}
"""Keys that name the recipe, or change the goals of a task."""


@pytest.fixture(scope="module")
def networks():
    """All networks of all strategies; what is not trained is not run either."""
    shipped = shipped_networks(TWIN)
    gains = pcc.FittedPCC().untrained(TWIN, BEST, jax.random.key(0))
    fitted = {name: Trained(network) for name, network in gains.items()}
    return replace(shipped, trained={**shipped.trained, **fitted})


@pytest.fixture
def effect(monkeypatch, networks):
    """Text of all that a strategy trains by, and of the parts that it builds."""
    for module in (pcc, s2c2a):
        monkeypatch.setattr(module, "Planner", lambda *parts: parts[2])
        monkeypatch.setattr(module, "Strategy", lambda *parts: parts[2:])
    monkeypatch.setattr(pcc, "EncoderEstimator", lambda configuration_map: "encoders")
    for estimator in (KalmanFilter, EncoderOnly):
        monkeypatch.setattr(estimator, "build", lambda self, *given: (self, given[-1]))

    def effect_of(options: StrategyOptions, recipe: Recipe, run: RunOptions) -> str:
        used = options.recipe(recipe)
        training = ()
        if options.collect_options(used, 0) is not None:
            training = options.training_key(used), options.collect_options(used, 0)
        return repr((training, options.build(TWIN, used, networks, run)))

    return effect_of


@pytest.mark.parametrize("option", RUNS)
@pytest.mark.parametrize("name", STRATEGIES.known)
def test_an_option_of_a_run_changes_what_is_built_or_is_refused(name, option, effect):
    options = STRATEGIES.named(name)()
    run = RUNS[option]
    changes = effect(options, BEST, run) != effect(options, BEST, RunOptions())
    assert changes == (option in options.supports)
    conditions = Conditions(run=run)
    if changes:
        assert jobs_for(["circle"], TWIN, [name], [0], BEST, conditions)
        return
    named = rf"'{name}' does not support --(no-)?{option.replace('_', '-')} "
    with pytest.raises(StrategyError, match=named):
        jobs_for(["circle"], TWIN, [name], [0], BEST, conditions)


@pytest.mark.parametrize("key", CHANGED)
@pytest.mark.parametrize("name", STRATEGIES.known)
def test_a_strategy_uses_the_keys_of_a_recipe_that_it_declares(name, key, effect):
    options = STRATEGIES.named(name)()
    changed = replace(BEST, **{key: CHANGED[key]})
    run = RunOptions()
    changes = effect(options, changed, run) != effect(options, BEST, run)
    assert changes == (key in options.recipe_keys)


def test_all_options_and_all_keys_are_tried():
    settings = {field.name for field in fields(EstimationSettings)}
    assert RUNS.keys() == {"guard"} | settings
    keys = {field.name for field in fields(Recipe)}
    assert CHANGED.keys() | IN_THE_TASK == keys


def test_the_live_page_refuses_a_strategy_that_ignores_the_guard(monkeypatch):
    monkeypatch.setattr(pcc.FittedPCC, "supports", frozenset())
    with pytest.raises(StrategyError, match="'pcc-fitted' does not support --guard"):
        strategies_of(TWIN, ("shipped",), "arm", ("pcc-fitted",))


def own_strategy(file, *lines) -> str:
    """Name of a strategy of the user's own with such lines in its class."""
    file.write_text(
        "from dataclasses import dataclass\n"
        "from s2c2a.strategies import StrategyOptions, pcc_strategy\n"
        "@dataclass(frozen=True)\n"
        "class Own(StrategyOptions):\n"
        "    def build(self, arm, recipe, trained, run):\n"
        "        return pcc_strategy(arm, recipe.planner)\n"
        + "".join(f"    {line}\n" for line in lines)
    )
    return f"{file}:Own"


IGNORES = ("name = 'own'", "ignores = 'obstacles', 'other ends'")


@pytest.fixture
def ignorant(tmp_path):
    """Name of a strategy of the user's own that ignores two parts of goals."""
    return own_strategy(tmp_path / f"{tmp_path.name}.py", *IGNORES)


def short(name, steps=3):
    """The first steps of a task."""
    task = load_task(name, TWIN)
    return replace(task, goals=task.goals[:steps], scores=())


NEEDS = [("reach-1", "obstacles"), ("hold-middle", "other ends"), ("circle", "")]


@pytest.mark.parametrize(("task", "ignored"), NEEDS)
def test_a_run_in_python_says_once_what_a_strategy_ignores(ignorant, task, ignored):
    options = strategy_named(ignorant)
    driver = options.driver(TWIN, BEST, None, RunOptions())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        s2c2a_package.run(SimulatedRobot(TWIN), driver, short(task))
    said = [str(each.message) for each in caught]
    about = [text for text in said if "ignores" in text]
    expected = [f"own ignores what its goal has: {ignored}"] if ignored else []
    assert about == expected


@pytest.mark.parametrize(("task", "ignored"), NEEDS)
def test_jobs_say_once_what_a_strategy_ignores_before_it_is_trained(
    ignorant, tmp_path, task, ignored
):
    about = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        job, _ = jobs_for([short(task)], TWIN, [ignorant], [0, 1], BEST)
        about += [str(each.message) for each in caught]
        job.make(Cache(tmp_path), lambda *_: None)
    assert not any("ignores" in str(each.message) for each in caught[len(about) :])
    assert about == ([f"own ignores what its goal has: {ignored}"] if ignored else [])


def test_the_live_page_says_what_a_strategy_ignores(ignorant):
    builders = strategies_of(TWIN, (), "tip", (ignorant,))
    own = {"own": builders["own"]}
    control = ArmControl(SimulatedRobot(TWIN), own, {}, 10.0, StepClock())
    page = SimpleNamespace(
        _recorder=SimpleNamespace(running=False),
        _gap=0.0,
        _saturation=str,
        _disagreement=SimpleNamespace(text=""),
    )
    control._loop.open()

    def said(*obstacles):
        control.ask(driven=True, target=(0.1, 0.0, 0.55), obstacles=obstacles)
        for _ in range(3):
            control._tick()
        assert control.latest.stage is Stage.RUN
        details = " ".join(LivePage._details(page, control.latest))
        return control.latest.ignored, "ignores obstacles" in details

    assert said() == ("", False)
    with pytest.warns(UserWarning, match="ignores what its goal has: obstacles"):
        assert said(Obstacle((0.3, 0.0, 0.6), 0.1)) == ("obstacles", True)


@pytest.mark.parametrize(
    ("ignores", "message"),
    [
        ("'obstacles'", "ignores = 'obstacles' in Own: write a frozenset of axes"),
        ("{'obstacle'}", r"in Own \(did you mean obstacles\?\): write a frozenset"),
        ("5", "ignores = 5 in Own: write"),
        ("None", "ignores = None in Own: write"),
        ("[['axes']]", r"in Own \(did you mean axes\?\): write"),
    ],
)
def test_what_a_strategy_says_it_ignores_is_checked_wherever_it_is_made(
    tmp_path, ignores, message
):
    name = own_strategy(tmp_path / f"{tmp_path.name}.py", f"ignores = {ignores}")
    with pytest.raises(StrategyError, match=message):
        strategy_named(name)
    with pytest.raises(StrategyError, match=message):
        strategies_of(TWIN, (), "tip", (name,))
    kind = STRATEGIES.named(name)
    label = STRATEGIES.name_of(kind)
    networks = replace(shipped_networks(TWIN), strategy=label, strategy_options={})
    with pytest.raises(StrategyError, match=message):
        strategy_of(networks)


def test_what_a_controller_says_it_ignores_is_checked_by_the_loop():
    driver = pcc.pcc_strategy(TWIN)
    driver.ignores = frozenset({"obstacel"})
    with pytest.raises(StrategyError, match=r"in Strategy \(did you mean obstacles"):
        Loop(SimulatedRobot(TWIN), driver)


class Own(StrategyOptions):
    """A strategy of the user's own, without a name, whose controller is frozen."""

    ignores = frozenset({"obstacles"})

    def build(self, arm, recipe, trained, run):
        return FrozenDriver(pcc.pcc_strategy(arm))


@dataclass(frozen=True, slots=True)
class FrozenDriver:
    """A controller on which nothing can be kept."""

    parts: Strategy
    name = "frozen"

    def __getattr__(self, name):
        return getattr(self.parts, name)


def test_what_a_strategy_ignores_is_kept_beside_a_frozen_controller():
    driver = Own().driver(TWIN, BEST, None, RunOptions())
    with pytest.warns(UserWarning, match="^Own ignores what its goal has: obstacles$"):
        episode = s2c2a_package.run(SimulatedRobot(TWIN), driver, short("reach-1"))
    assert episode.options["strategy"] == "Own"
    assert driver.parts.arm is TWIN


def test_an_error_names_the_controller_and_not_what_its_strategy_states():
    driver = Own().driver(TWIN, BEST, None, RunOptions())
    driver.parts.act = lambda plan, estimate: 1 / 0
    with pytest.raises(ControllerError, match=r"^FrozenDriver\.act failed in step 0"):
        s2c2a_package.run(SimulatedRobot(TWIN), driver, short("circle"))
    with pytest.raises(S2C2AError, match="the controller object has no `arm`"):
        Loop(SimulatedRobot(TWIN), StatedDriver(object(), "own", frozenset()))


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("ignore = {'obstacles'}", "ignores"),
        ("ingores = {'obstacles'}", "ignores"),
        ("support = {'guard'}", "supports"),
        ("recipe_key = {'planner'}", "recipe_keys"),
    ],
)
def test_a_misspelled_statement_of_a_strategy_is_refused(tmp_path, line, meant):
    name = own_strategy(tmp_path / f"{tmp_path.name}.py", line)
    given = line.partition(" ")[0]
    with pytest.raises(
        StrategyError, match=f"Own has `{given}`; did you mean `{meant}`"
    ):
        strategy_named(name)


@pytest.mark.parametrize("name", ["ignore", "set_realtime"])
def test_a_misspelled_statement_of_a_controller_is_refused(name):
    driver = pcc.pcc_strategy(TWIN)
    setattr(driver, name, frozenset({"obstacles"}))
    with pytest.raises(StrategyError, match=f"Strategy has `{name}`; did you mean"):
        Loop(SimulatedRobot(TWIN), driver)


def test_a_step_asks_for_parts_of_a_goal_only_where_some_are_ignored(monkeypatch):
    asked = []
    parts = property(lambda goal: asked.append(goal) or frozenset())
    monkeypatch.setattr(Goal, "parts", parts)
    s2c2a_package.run(SimulatedRobot(TWIN), pcc.pcc_strategy(TWIN), short("circle"))
    assert not asked


def test_options_follow_the_name_of_a_strategy_behind_commas(tmp_path):
    folder = tmp_path / "a,b"
    folder.mkdir()
    own = own_strategy(folder / "own.py", "gain: float = 0.5", "count: int = 3")
    assert strategy_named(own).gain == 0.5
    chosen = strategy_named(f"{own},gain=0.25,count=7")
    assert (chosen.gain, chosen.count) == (0.25, 7)
    with pytest.raises(S2C2AError, match="has no option 'gian'"):
        strategy_named(f"{own},gian=1")
    with pytest.raises(S2C2AError, match="count=many"):
        strategy_named(f"{own},count=many")
    offered = strategies_of(TWIN, (), "tip", (own, f"{own},gain=0.25"))
    assert {"Own", "Own,gain=0.25"} <= set(offered)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("def __post_init__(self): 1 / 0", "cannot be made: ZeroDivisionError"),
        ("build = StrategyOptions.build", "cannot be made: TypeError: .*abstract"),
    ],
)
def test_a_class_that_cannot_be_made_is_named(tmp_path, line, message):
    file = tmp_path / f"{tmp_path.name}.py"  # a module name of its own
    with pytest.raises(StrategyError, match=message):
        strategy_named(own_strategy(file, line))


def test_what_a_strategy_needs_is_asked_before_anything_is_made(monkeypatch):
    (job,) = jobs_for(["circle"], TWIN, ["pcc-fitted"], [0], BEST)
    monkeypatch.setattr(pcc.FittedPCC, "collect_options", lambda *_: 1 / 0)
    with pytest.raises(StrategyError, match="cannot state what it needs: ZeroDiv"):
        _ = job.needs
