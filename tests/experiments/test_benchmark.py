"""The benchmark of planners: who takes part in what, what is scored, what is written."""

import csv
import json
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a.arm import load_arm, save_arm
from s2c2a.cli.execution import ALL_CORES
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.execution.progress import quiet
from s2c2a.goals import Goal
from s2c2a.integrations.environments.policy import observation_size, save_policy
from s2c2a.integrations.environments.spaces import Controls
from s2c2a.jobs import Cache
from s2c2a.strategies import strategy_named
from s2c2a.tasks import Task
from s2c2a_experiments.benchmark import command, figure, protocol, tune
from s2c2a_experiments.benchmark.cells import Cell, Result, all_cells, run_cells
from s2c2a_experiments.benchmark.command import benchmark, one_of_each_file
from s2c2a_experiments.benchmark.entrants import (
    entrant_of,
    entrants,
    untuned,
    with_weights,
)
from s2c2a_experiments.benchmark.result_files import load_results, save_results
from s2c2a_experiments.benchmark.results import (
    PlannerComparison,
    arm_table,
    draw,
    lines,
)
from s2c2a_experiments.benchmark.scores import (
    keeps_clear,
    log_jerk,
    path_length_ratio,
    success_of,
)
from s2c2a_experiments.benchmark.search_space import range_from
from s2c2a_experiments.benchmark.tune import TRIALS, drawn_trials

TWIN = load_arm("twin_arm")
TWIN_ARM = protocol.BenchmarkArm(TWIN, "preset")
PCC = entrant_of("pcc")
OWN = '''
from dataclasses import dataclass
from s2c2a.strategies import StrategyOptions, pcc_strategy

@dataclass(frozen=True)
class Mine(StrategyOptions):
    """Arcs."""

    name = "mine"
    ignores = frozenset({"obstacles"})

    def build(self, arm, recipe, trained, run):
        return pcc_strategy(arm, recipe.planner)
'''


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    file = tmp_path_factory.mktemp("entry") / "mine.py"
    file.write_text(OWN)
    return f"{file}:Mine"


@pytest.fixture
def short(monkeypatch):
    """A protocol of one arm, whose path has 12 steps."""

    def goals(arm):
        whole = protocol.load_task("circle", arm.arm)
        return [replace(whole, goals=whole.goals[:12])]

    path = replace(protocol.TASKS["path"], goals=goals)
    monkeypatch.setattr(protocol, "TASKS", protocol.TASKS | {"path": path})
    monkeypatch.setattr(protocol, "protocol_arms", lambda: [TWIN_ARM])


def test_an_entry_from_a_file_is_in_the_table_by_one_command(
    own, short, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    arguments = {"entry": (own,), "only": ("pcc",), "task": ("path", "obstacles")}
    work = replace(ALL_CORES, out=tmp_path / "run", jobs=1)
    benchmark(**arguments, smoke=True, work=work)
    table = list(csv.reader((tmp_path / "run" / "planners.csv").open(encoding="utf-8")))
    assert {line[0] for line in table[1:]} == {"`mine`", "`pcc`"}
    notes = (tmp_path / "run" / "planners.md").read_text(encoding="utf-8")
    assert "`mine` ignores obstacles: obstacles" in notes
    saved = (tmp_path / "run" / "planners.json").read_text(encoding="utf-8")
    assert {each["entrant"] for each in json.loads(saved)["results"]} == {"mine", "pcc"}
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "run/runs").iterdir()}
    benchmark(only=("pcc",), smoke=True, work=work)  # others in the same directory
    benchmark(**arguments, smoke=True, work=work)  # again, from what is kept
    assert (tmp_path / "run" / "planners.json").read_text(encoding="utf-8") == saved
    assert kept.items() <= {
        (file, file.stat().st_mtime_ns) for file in (tmp_path / "run/runs").iterdir()
    }
    with (tmp_path / "run" / "cells.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["entrant"], row["task"], row["runs"]) for row in rows] == [
        ("pcc", "path", "1"),
        ("pcc", "obstacles", "1"),
        ("mine", "path", "1"),
    ]


def test_an_entry_brings_its_networks_for_the_arm_of_their_file(tmp_path):
    file = tmp_path / "mine.safetensors"
    controls = Controls.of(TWIN)
    layer = np.zeros((controls.count, observation_size(controls)))
    hidden = np.eye(layer.shape[1])
    layers = [(hidden, hidden[0]), (hidden, hidden[0]), (layer, layer[:, 0])]
    save_policy(file, TWIN, layers)
    plain = entrant_of("policy")
    (entrant,) = with_weights([plain], [file])
    cell = Cell(entrant, protocol.TASKS["path"], TWIN_ARM)
    (job,) = cell.make_jobs(["circle"], [0])
    assert job.needs == (entrant.weights,)
    other = protocol.BenchmarkArm(load_arm("simulated_arm"), "preset")
    assert replace(cell, arm=other).dash == "was trained for twin_arm alone"
    assert replace(cell, task=protocol.TASKS["obstacles"]).dash == "ignores obstacles"
    saved = tmp_path / "planners.json"
    save_results([Result(cell, {"success": [1.0]}, (), None, {})], (0,), saved)
    assert load_results(saved, [replace(cell, entrant=plain)], (0,)) == ([], 1)
    with pytest.raises(
        S2C2AError, match="holds networks of policy, and --entry is pcc"
    ):
        with_weights([PCC], [file])
    with pytest.raises(S2C2AError, match="is the second file of policy"):
        with_weights([plain], [file, file])
    with pytest.raises(S2C2AError, match="for the arm twin_arm, and --arm has planar"):
        benchmark(
            entry=("policy",), weights=(file,), only=("none",), arm=("planar_finger",)
        )


def test_the_smoke_version_has_one_entrant_of_each_file_and_the_users_own(own):
    chosen = one_of_each_file([*untuned(), entrant_of(own)])
    names = [each.name for each in chosen]
    assert {"rrt", "pcc", "mine"} <= set(names)
    assert not {"rrt-star", "pcc-horizon"} & set(names)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"only": ("pc",)}, r"no entrant 'pc' .did you mean pcc"),
        ({"entry": ("pcc",), "only": ("pcc",)}, "two entrants are named 'pcc'"),
        ({"arm": ("twin",)}, r"no arm 'twin' .did you mean twin_arm"),
        ({"arm": ("other.toml",)}, r"no arm 'other.toml': .* nor a file"),
        ({"tune": True, "entry": ("mine.py:Mine",)}, "leave out"),
        ({"tune": True, "seeds": 7}, "leave out"),
        ({"tune": True, "only": ("ppo",)}, "none of these entrants is tuned"),
        ({"smoke": True, "only": ("best",)}, "leaves out entrants with training"),
        (
            {"smoke": True, "only": ("pcc",), "task": ("orientation",)},
            "tasks path and obstacles",
        ),
        ({"smoke": True, "only": ("pcc",), "seeds": 0}, "at least one"),
    ],
)
def test_arguments_that_make_no_benchmark_are_refused(arguments, message):
    with pytest.raises(S2C2AError, match=message):
        benchmark(**arguments)


def test_arms_of_the_user_take_part_and_keep_their_names_apart(tmp_path):
    mine = tmp_path / "mine.arm.toml"
    save_arm(TWIN.model_copy(update={"name": "mine"}), mine)
    (arm,) = command.chosen_arms((str(mine),), smoke=False)
    assert (arm.arm.name, arm.group) == ("mine", "yours")
    save_arm(TWIN, mine, overwrite=True)
    with pytest.raises(S2C2AError, match="two arms are named 'twin_arm'"):
        command.chosen_arms((str(mine), "twin_arm"), smoke=False)


def test_every_entrant_takes_part_in_what_it_does_not_ignore():
    arms = [TWIN_ARM]
    cells = all_cells(entrants(), list(protocol.TASKS.values()), arms)
    finger = protocol.BenchmarkArm(load_arm("planar_finger"), "yours")
    assert Cell(PCC, protocol.TASKS["constraint"], finger).dash == (
        "is given no arm of 3 modules"
    )
    dashes = {(cell.entrant.name, cell.task.name): cell.dash for cell in cells}
    assert dashes["best", "known payload"] == ""
    for name in ("pcc", "paper"):
        assert dashes[name, "known payload"] == "has no place for a known payload"
    assert dashes["online-jacobian", "obstacles"] == "ignores obstacles"
    assert all(not dashes[name, "path"] for name, _ in dashes)


def test_a_cell_knows_the_payload_only_where_the_task_says_so():
    best = next(each for each in untuned() if each.name == "best")
    known = {}
    for name in ("payload", "known payload"):
        task = protocol.TASKS[name]
        (job,) = Cell(best, task, TWIN_ARM).make_jobs(task.tasks(TWIN_ARM), (0,))
        known[name] = job.conditions.run.estimation.known_payload
        assert float(dict(job.conditions.robot.options)["payload"]) == pytest.approx(
            0.2 * 0.24
        )
    assert known == {"payload": 0.0, "known payload": pytest.approx(0.048)}


def test_every_entrant_is_tuned_in_at_most_four_places_from_itself_within_ranges():
    for each in untuned():
        ranges = {item.place: item for item in map(range_from, each.tuned)}
        assert len(ranges) == len(each.tuned) <= 4
        trials = drawn_trials(each)
        first = each.with_values(trials[0])
        assert (first.recipe, first.options) == (each.recipe, each.options)
        assert len(trials) == TRIALS
        assert trials == drawn_trials(each)
        for values in trials:
            tried = each.with_values(values)
            assert strategy_named(tried.strategy)
            assert values.keys() == ranges.keys()
            for place, value in values.items():
                assert ranges[place].low <= value <= ranges[place].high


def test_the_arms_of_the_protocol_are_distinct_and_none_is_that_of_tuning():
    arms = [*protocol.protocol_arms(), protocol.tuning_arm()]
    assert len({each.arm.name for each in arms}) == len(arms)


def result(entrant, task, success, arm=TWIN_ARM, **metrics):
    cell = Cell(entrant, protocol.TASKS[task], arm)
    values = {"success": success, **metrics}
    return Result(cell, values, (), (1.0, 2.0), {"s2c2a": "0"})


def compared(*results, seeds=1):
    entrants = {each.cell.entrant.name: each.cell.entrant for each in results}
    return PlannerComparison([*entrants.values()], results, [], range(seeds))


def named_arm(name, group="preset"):
    return protocol.BenchmarkArm(TWIN.model_copy(update={"name": name}), group)


def test_an_arm_that_an_entrant_leaves_out_counts_as_no_success():
    other = entrant_of("online-jacobian")
    first, second = named_arm("first"), named_arm("second")
    comparison = compared(
        result(PCC, "path", [1.0, 1.0], first),
        result(PCC, "path", [0.0, 1.0], second),
        result(other, "path", [1.0, 1.0], first),
        seeds=2,
    )
    names = comparison.arms(held_out=False)
    assert comparison.success("pcc", names).tolist() == [0.5, 1.0]
    assert comparison.success("online-jacobian", names).tolist() == [0.5, 0.5]
    assert np.isnan(comparison.success("pcc", comparison.arms(held_out=True))).all()
    assert lines(comparison)[0][2:4] == ["75 ± 35 %", "-"]
    assert arm_table(comparison) == (
        ["entrant", "first", "second"],
        [["`pcc`", "100 %", "50 %"], ["`online-jacobian`", "100 %", "-"]],
    )


def test_main_arms_alone_count_in_times_unless_all_are_held_out():
    first = result(PCC, "path", [1.0], named_arm("first"))
    second = result(PCC, "path", [1.0], named_arm("second", "held out"))
    second = replace(second, step=(9.0, 9.0))
    assert compared(first, second).step_times("pcc") == (1.0, 2.0)
    held_out = compared(second)
    assert held_out.step_times("pcc") == (9.0, 9.0)
    assert lines(held_out)[0][2:5] == ["-", "100 %", "100 %; -"]


def test_equal_success_is_ranked_by_error():
    other = entrant_of("online-jacobian")
    worse = result(PCC, "path", [1.0], error=[2.0])
    comparison = compared(worse, result(other, "path", [1.0], error=[1.0]))
    assert [line[0] for line in lines(comparison)] == ["`online-jacobian`", "`pcc`"]


def test_a_known_payload_is_no_part_of_success_where_other_tasks_are():
    known = result(PCC, "known payload", [0.0])
    both = compared(result(PCC, "path", [1.0]), known)
    assert both.success("pcc", ["twin_arm"]) == 1.0
    assert compared(known).success("pcc", ["twin_arm"]) == 0


def test_touches_are_counted_and_a_failed_run_never_settles():
    values = {"error": [1.0, 2.0], "clearance": [3.0, -3.0], "settling": [2.0, 15.0]}
    runs = result(PCC, "obstacles", [1.0, 0.0, 0.0], **values)
    comparison = compared(runs)
    assert lines(comparison)[0][4] == "33 %; 1.5; 50 %"
    assert comparison.settling("pcc") == 15.0
    failed = replace(runs, metrics={"success": [0.0, 0.0, 0.0]})
    assert np.isinf(compared(failed).settling("pcc"))


def test_a_benchmark_in_which_every_run_fails_still_draws(tmp_path):
    failed = replace(result(PCC, "path", [0.0]), step=None)
    assert draw(compared(failed), tmp_path / "planners.png").is_file()


@pytest.fixture
def file(tmp_path):
    """A file that says that `pcc` succeeds in a half of a task."""
    path = tmp_path / "known.json"
    save_results([result(PCC, "path", [0.5])], (0,), path)
    return path


def test_results_count_for_the_same_options_arm_task_and_group_alone(tmp_path):
    kept = tmp_path / "known.json"
    held_out = protocol.held_out()[0]
    task = replace(protocol.TASKS["obstacles"], scenes=1)
    tuned = next(each for each in entrants() if each.name == "pcc")
    cell = Cell(tuned, task, held_out)
    saved = replace(FAILED, cell=cell)
    save_results([saved], (0,), kept)
    assert load_results(kept, [cell], (0,)) == ([saved], 0)
    slower = held_out.arm.model_copy(update={"control_rate": 5.0})
    for other in (
        replace(
            cell, entrant=tuned.with_values({"planner.solver.learning_rate": 0.02})
        ),
        replace(cell, arm=replace(held_out, arm=slower)),
        replace(cell, arm=replace(held_out, group="yours")),
        replace(cell, task=protocol.TASKS["obstacles"]),
    ):
        assert load_results(kept, [other], (0,)) == ([], 1)
    save_results([replace(FAILED, cell=replace(cell, task=other.task))], (0,), kept)
    with pytest.raises(S2C2AError, match=r"1 run of pcc .* 3 a seed"):
        load_results(kept, [other], (0,))


def test_results_of_an_entry_belong_to_its_code_wherever_it_lies(tmp_path):
    code = tmp_path / "changing.py"
    code.write_text(OWN)
    kept = tmp_path / "known.json"
    one = entrant_of(f"{code}:Mine")
    save_results([result(one, "path", [0.5])], (0,), kept)
    elsewhere = entrant_of(f"{tmp_path}/../{tmp_path.name}/changing.py:Mine")
    cells = [Cell(elsewhere, protocol.TASKS["path"], TWIN_ARM)]
    assert len(load_results(kept, cells, (0,))[0]) == 1
    code.write_text(OWN + "\nLATER = 1\n")
    assert load_results(kept, cells, (0,)) == ([], 1)


FAILED = Result(
    None, {"success": [0.0]}, ("no plan; give another",), None, {"s2c2a": "0"}
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"protocol": 0}, "of protocol 0, and this is protocol 2"),
        ({"seeds": [0, 1]}, "of seeds .0, 1., and .0. are asked for"),
        ({"versions": []}, "no versions 0"),
        ({"versions": [{"s2c2a": "\x1b[2J"}]}, "s2c2a"),
        ({"results": [{"entrant": "pcc"}]}, "results.0.task"),
        ({"metrics": {"success": []}}, "a share from 0 to 1 for every run"),
        ({"metrics": {"success": [2.0]}}, "a share from 0 to 1 for every run"),
        ({"metrics": {"success": [1.0], "error": [1.0, 2.0]}}, "more values than"),
        ({"metrics": {"success": [1.0], "eror": [1.0]}}, "eror"),
        ({"metrics": {"success": [1.0], "error": [float("nan")]}}, "error"),
        ({"metrics": {"success": [1.0], "error": [-1.0]}}, "'error' has a negative"),
        ({"step": [-1.0, 1.0]}, "step"),
        ({"failures": ["\x1b[2J"]}, "failures"),
        ({"failures": ["\u202egnp.exe"]}, "failures"),
        ({"failures": ["lost", "lost"]}, "more failures than runs"),
        ({"entrant": "a`b"}, "without backquotes"),
    ],
)
def test_files_of_other_results_are_refused(file, change, message):
    content = json.loads(file.read_text(encoding="utf-8"))
    if change.keys() <= content.keys():
        content |= change
    else:
        content["results"][0] |= change
    file.write_text(json.dumps(content))
    with pytest.raises(S2C2AError, match=message):
        load_results(file, [], (0,))


def test_messages_of_runs_are_one_line_that_a_terminal_shows_as_it_is():
    cell = Cell(PCC, protocol.TASKS["path"], TWIN_ARM)
    (failed,) = run_cells(
        [cell], (0,), lambda runs: [S2C2AError("lost\n\x1b[2Jtip") for _ in runs]
    )
    assert failed.failures == ("lost [2Jtip",)
    assert (failed.metrics, failed.step) == ({"success": [0.0]}, None)


@pytest.fixture
def plotted(monkeypatch):
    """A function that draws success over time, and returns its figure and axes."""
    made = []
    monkeypatch.setattr(figure, "save_figure", lambda drawn, path: made.append(drawn))

    def plot(points, **partial):
        errors = {name: np.ones(3) for name in points}
        figure.planners_figure(errors, 3, points, "planners.png", **partial)
        return made[0], made[0].axes[1]

    return plot


def test_no_names_of_planners_overlap_in_the_figure(plotted):
    random = np.random.default_rng(0)
    places = random.uniform((1.0, 0.0), (2.0, 1.0), (7, 2))
    points = {f"planner {number}": tuple(place) for number, place in enumerate(places)}
    points |= {"same": (1.5, 0.9), "equal": (1.5, 0.9), "highest": (2.0, 1.0)}
    drawn, axes = plotted(points)
    drawn.draw_without_rendering()
    texts = [text for text in axes.texts if text.get_text()]
    # two pixels apart, or names of one line read as one
    boxes = [text.get_window_extent().padded(1) for text in texts]
    assert len(boxes) == len(points)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_all_entrants_get_the_same_goals_and_the_whole_axis_counts():
    networks = [each for each in entrants() if each.name in ("paper", "best")]
    for name in ("constraint", "orientation"):
        (task,) = protocol.TASKS[name].tasks(TWIN_ARM)
        weights = [each.recipe.axis_weight(task.name) for each in networks]
        assert weights == [1.0, 1.0]
    assert [score.metric for score in task.scores] == ["position", "orientation"]


def test_tuning_takes_the_trial_with_the_smallest_error_and_leaves_out_failed_ones(
    monkeypatch, tmp_path
):
    (apf,) = (each for each in untuned() if each.name == "apf")
    trials = drawn_trials(apf)

    def runs(jobs, *_):
        places = [number // (len(jobs) // TRIALS) for number in range(len(jobs))]
        position = SimpleNamespace(metric="position")
        return [
            S2C2AError("failed")
            if place == 3
            else SimpleNamespace(
                scores=[SimpleNamespace(score=position, value=abs(place - 4.2))]
            )
            for place in places
        ]

    monkeypatch.setattr(tune, "TUNED_BY", ("path",))  # the other one takes long to make
    monkeypatch.setattr(tune, "try_all", runs)
    found = tune.tune([apf], Cache(tmp_path), None, quiet)
    assert found == {"apf": trials[4]}
    monkeypatch.setattr(tune, "try_all", lambda jobs, *_: [S2C2AError("x")] * len(jobs))
    with pytest.raises(S2C2AError, match="all 10 trials of 'apf' failed"):
        tune.tune([apf], Cache(tmp_path), None, quiet)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("name = 5", "name = 5 in Mine .*: write text of one line"),
        (r'name = "a\nb"', "write text of one line"),
        ("name = 'a`b'", "without backquotes"),
        ('ignores = "obstacles"', "ignores = 'obstacles' in Mine: write a frozenset"),
        ('ignores = frozenset({"obstacle"})', "a frozenset of axes, obstacles, other"),
    ],
)
def test_what_an_entry_states_about_itself_is_checked(tmp_path, line, message):
    file = tmp_path / f"{tmp_path.name}.py"  # a module name of its own
    file.write_text(f"{OWN}\n    {line}\n")
    with pytest.raises(StrategyError, match=message):
        entrant_of(f"{file}:Mine")


def test_success_is_graded_and_a_missing_figure_is_none():
    assert success_of([2.4], [4.9]) == 1.0
    assert success_of([2.4], [9.9]) == pytest.approx(2 / 3)
    assert success_of([9.9, 1.0], []) == pytest.approx(1 / 3)
    assert success_of([np.nan], []) == 0.0
    clear = [[], [0.0, -0.3], [0.0, -0.4], [np.nan]]
    assert list(map(keeps_clear, clear)) == [True, True, False, False]


def test_the_path_length_counts_from_where_the_tip_was():
    goals = [Goal.of(3).with_position([0.1 * step, 0.0, 0.5]) for step in (1, 2)]
    task = Task("line", tuple(goals))
    start = np.array([[0.0, 0.0, 0.5]])
    straight = np.array([[0.1, 0.0, 0.5], [0.2, 0.0, 0.5]])
    assert path_length_ratio(start, straight, task) == pytest.approx(1.0)
    detour = np.array([[0.1, 0.1, 0.5], [0.2, 0.0, 0.5]])
    assert path_length_ratio(start, detour, task) == pytest.approx(np.sqrt(2.0))


def test_the_line_holds_those_that_nobody_beats_in_both_on_all_arms(plotted):
    points = {"slow": (9.0, 0.9), "fast": (1.0, 0.5), "beaten": (2.0, 0.4)}
    points |= {"one arm": (0.5, 1.0)}
    _, axes = plotted(points, partial=["one arm"])
    lines = {line.get_label(): line for line in axes.lines}
    front = lines["beaten by none in both"].get_xydata().tolist()
    assert front == [[1.0, 0.5], [9.0, 0.9]]
    hollow = [line for line in axes.lines if line.get_markerfacecolor() == "none"]
    assert [line.get_xydata().tolist() for line in hollow] == [[[0.5, 1.0]], []]
    assert hollow[-1].get_label() == "not on all arms"


def test_a_trembling_motion_has_more_jerk_however_long_and_wide_it_is():
    times = np.linspace(0.0, 1.0, 200)[:, None]
    smooth = 0.1 * (10 * times**3 - 15 * times**4 + 6 * times**5) * np.eye(3)[0]
    trembling = smooth + 1e-3 * np.sin(80 * times) * np.eye(3)[1]
    assert log_jerk(trembling, 0.01) > log_jerk(smooth, 0.01) + 1.0
    assert log_jerk(3.0 * smooth, 0.02) == pytest.approx(log_jerk(smooth, 0.01))


@pytest.mark.parametrize("task", protocol.TASKS.values(), ids=protocol.TASKS)
def test_a_task_needs_what_its_goals_give(task):
    assert {each.needs for each in task.tasks(TWIN_ARM)} == {task.needs}
