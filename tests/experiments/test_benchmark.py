"""The benchmark of planners: who takes part in what, what is scored, what is written."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.tasks import Task
from s2c2a_experiments.benchmark import protocol
from s2c2a_experiments.benchmark.cells import Cell, Result, all_cells
from s2c2a_experiments.benchmark.command import benchmark, one_of_each_file
from s2c2a_experiments.benchmark.entrants import entrant_of, entrants, untuned
from s2c2a_experiments.benchmark.result_files import load_results, save_results
from s2c2a_experiments.benchmark.results import (
    PlannerComparison,
    arm_table,
    draw,
    lines,
)
from s2c2a_experiments.benchmark.scores import log_jerk, success_of, way_ratio
from s2c2a_experiments.figures.planners import pareto
from s2c2a_experiments.search_space import value_at, varied_from

TWIN = load_arm("twin_arm")
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
    arms = [protocol.BenchmarkArm(TWIN, "preset")]
    monkeypatch.setattr(protocol, "TASKS", protocol.TASKS | {"path": path})
    monkeypatch.setattr(protocol, "protocol_arms", lambda: arms)


def test_an_entry_from_a_file_is_in_table_and_page_by_one_command(
    own, short, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    arguments = {"entry": (own,), "only": ("pcc",), "task": ("path", "obstacles")}
    work = replace(protocol_work(), out=tmp_path / "run", jobs=1)
    benchmark(**arguments, smoke=True, work=work)
    table = list(csv.reader((tmp_path / "run" / "planners.csv").open(encoding="utf-8")))
    assert {line[0] for line in table[1:]} == {"`mine`", "`pcc`"}
    notes = (tmp_path / "run" / "planners.md").read_text(encoding="utf-8")
    assert "`mine` ignores obstacles: obstacles" in notes
    page = (tmp_path / "run" / "planners.html").read_text(encoding="utf-8")
    assert "<code>mine</code>" in page
    saved = (tmp_path / "run" / "planners.json").read_text(encoding="utf-8")
    assert {each["entrant"] for each in json.loads(saved)["results"]} == {"mine", "pcc"}
    benchmark(**arguments, smoke=True, work=work)  # again, from what is kept
    assert (tmp_path / "run" / "planners.json").read_text(encoding="utf-8") == saved


def protocol_work():
    from s2c2a.cli.execution import ALL_CORES  # noqa: PLC0415  # a command's option

    return ALL_CORES


def test_the_smoke_version_has_one_entrant_of_each_file_and_the_users_own(own):
    chosen = one_of_each_file([*untuned(), entrant_of(own)])
    names = [each.name for each in chosen]
    assert {"rrt", "pcc", "mine"} <= set(names)
    assert not {"rrt-star", "pcc-horizon"} & set(names)


def test_names_of_the_protocol_are_checked(own):
    with pytest.raises(S2C2AError, match=r"no entrant 'pc' .did you mean pcc"):
        benchmark(only=("pc",))
    with pytest.raises(S2C2AError, match="two entrants are named 'pcc'"):
        benchmark(entry=("pcc",), only=("pcc",))


def test_every_entrant_takes_part_in_what_it_does_not_ignore():
    arms = [protocol.BenchmarkArm(TWIN, "preset")]
    cells = all_cells(entrants(), list(protocol.TASKS.values()), arms)
    dashes = {(cell.entrant.name, cell.task.name): cell.dash for cell in cells}
    assert dashes["best", "known payload"] == ""
    for name in ("pcc", "paper"):
        assert dashes[name, "known payload"] == "has no place for a known payload"
    assert dashes["online-jacobian", "obstacles"] == "ignores obstacles"
    assert all(not dashes[name, "path"] for name, _ in dashes)


def test_a_cell_knows_the_payload_only_where_the_task_says_so():
    best = next(each for each in untuned() if each.name == "best")
    arm = protocol.BenchmarkArm(TWIN, "preset")
    told = {}
    for name in ("payload", "known payload"):
        task = protocol.TASKS[name]
        (job,) = Cell(best, task, arm).make_jobs(task.goals(arm), (0,))
        told[name] = job.conditions.run.estimation.known_payload
        assert float(dict(job.conditions.robot.options)["payload"]) == pytest.approx(
            0.2 * 0.24
        )
    assert told == {"payload": 0.0, "known payload": pytest.approx(0.048)}


def test_every_entrant_is_tuned_in_places_that_exist_and_at_most_four():
    for each in untuned():
        assert len(each.tuned) <= 4
        if each.tuned:
            varied_from(each.tuned, each.recipe, each.strategy)


def test_the_files_of_the_protocol_hold_arms_that_steer():
    arms = protocol.protocol_arms()
    groups = [each.group for each in arms]
    assert [groups.count(name) for name in ("preset", "randomized", "held out")] == [
        2,
        4,
        2,
    ]
    assert len({each.arm.name for each in arms}) == len(arms)
    assert protocol.tuning_arm().arm.name not in {each.arm.name for each in arms}


def result(entrant, task, arm, success):
    cell = Cell(entrant, protocol.TASKS[task], arm)
    return Result(cell, {"success": success}, (), (1.0, 2.0), {"s2c2a": "0"})


def test_an_arm_that_an_entrant_leaves_out_counts_as_no_success():
    one, other = entrant_of("pcc"), entrant_of("online-jacobian")
    arms = [
        protocol.BenchmarkArm(TWIN.model_copy(update={"name": name}), "preset")
        for name in ("first", "second")
    ]
    results = [
        result(one, "path", arms[0], [1.0, 1.0]),
        result(one, "path", arms[1], [0.0, 1.0]),
        result(other, "path", arms[0], [1.0, 1.0]),
    ]
    comparison = PlannerComparison([one, other], results, [], (0, 1))
    names = comparison.arms(held_out=False)
    assert comparison.success("pcc", names) == 0.75
    assert comparison.success("online-jacobian", names) == 0.5
    assert np.isnan(comparison.success("pcc", comparison.arms(held_out=True)))
    assert lines(comparison)[0][2:4] == ["75 %", "-"]
    assert arm_table(comparison) == (
        ["entrant", "first", "second"],
        [["`pcc`", "100 %", "50 %"], ["`online-jacobian`", "100 %", "-"]],
    )


@pytest.fixture
def file(short, tmp_path):
    """A file that says that `pcc` succeeds in a half of a task."""
    (arm,) = protocol.protocol_arms()
    pcc = next(each for each in entrants() if each.name == "pcc")
    path = tmp_path / "known.json"
    save_results([result(pcc, "path", arm, [0.5])], (0,), path)
    return path


def test_what_a_file_of_results_holds_is_not_run_again(own, file, tmp_path, capsys):
    work = replace(protocol_work(), out=tmp_path / "run", jobs=1)
    benchmark(
        entry=(own,),
        only=("pcc",),
        task=("path",),
        seeds=1,
        results=(str(file),),
        work=work,
    )
    saved = json.loads((tmp_path / "run" / "planners.json").read_text(encoding="utf-8"))
    results = {each["entrant"]: each for each in saved["results"]}
    assert results["pcc"]["figures"] == {"success": [0.5]}
    assert results["mine"]["figures"]["error"]
    assert saved["versions"][results["pcc"]["versions"]] == {"s2c2a": "0"}
    assert "1 of 2 entrants' tasks, made with s2c2a 0" in capsys.readouterr().out


def test_results_count_for_the_same_options_alone(own, file):
    pcc = next(each for each in entrants() if each.name == "pcc")
    other = pcc.with_values({"planner.solver.learning_rate": 0.02})
    arms = protocol.protocol_arms()
    for entrant, count in ((pcc, 1), (other, 0)):
        cells = all_cells([entrant], [protocol.TASKS["path"]], arms)
        assert len(load_results(file, cells, (0,))) == count


def test_results_change_with_the_code_of_an_entry(own, tmp_path):
    file = tmp_path / "changing.py"
    file.write_text(OWN)
    kept = tmp_path / "known.json"
    arm = protocol.BenchmarkArm(TWIN, "preset")
    one = entrant_of(f"{file}:Mine")
    save_results([result(one, "path", arm, [0.5])], (0,), kept)
    cells = [Cell(one, protocol.TASKS["path"], arm)]
    assert len(load_results(kept, cells, (0,))) == 1
    file.write_text(OWN + "\nLATER = 1\n")
    assert load_results(kept, cells, (0,)) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"protocol": 0}, "its protocol is 0, not 1"),
        ({"seeds": [0, 1]}, "results of seeds .0, 1., and .0,. are asked"),
        ({"versions": []}, "no versions 0"),
        ({"results": [{"entrant": "pcc"}]}, "Field required"),
    ],
)
def test_files_of_other_results_are_refused(file, change, said):
    content = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps(content | change))
    with pytest.raises(S2C2AError, match=said):
        load_results(file, [], (0,))


def test_a_known_payload_is_no_part_of_success_where_other_tasks_are():
    best = entrant_of("pcc")
    arm = protocol.BenchmarkArm(TWIN, "preset")
    known = result(best, "known payload", arm, [0.0])
    both = [result(best, "path", arm, [1.0]), known]
    assert PlannerComparison([best], both, [], (0,)).success("pcc", ["twin_arm"]) == 1.0
    assert (
        PlannerComparison([best], [known], [], (0,)).success("pcc", ["twin_arm"]) == 0
    )


def test_a_benchmark_in_which_every_run_fails_still_draws(tmp_path):
    one = entrant_of("pcc")
    arm = protocol.BenchmarkArm(TWIN, "preset")
    failed = replace(result(one, "path", arm, [0.0]), step=None)
    comparison = PlannerComparison([one], [failed], [], (0,))
    assert draw(comparison, tmp_path / "planners.png").is_file()


def test_all_entrants_get_the_same_goals_and_the_whole_axis_counts():
    arm = protocol.BenchmarkArm(TWIN, "preset")
    names = {}
    for name in ("constraint", "orientation"):
        (task,) = protocol.TASKS[name].goals(arm)
        names[name] = [score.metric for score in task.scores]
        for each in entrants():
            if each.name in ("paper", "best"):
                assert each.recipe.axis_weight(task.name) == 1.0
    assert names["orientation"] == ["position", "orientation"]


def test_tuning_starts_from_the_entrant_as_it_is_and_refuses_what_it_ignores(own):
    for each in untuned():
        for varied in (
            varied_from(each.tuned, each.recipe, each.strategy) if each.tuned else ()
        ):
            assert varied.holds(value_at(each.recipe, varied.place, each.strategy))
    with pytest.raises(S2C2AError, match="leave out"):
        benchmark(tune=True, entry=(own,))


def test_success_is_graded_and_a_touch_or_a_missing_figure_ends_it():
    assert success_of([2.4], [4.9], [0.0]) == 1.0
    assert success_of([2.4], [9.9], [-0.3]) == pytest.approx(2 / 3)
    assert success_of([9.9, 1.0], [], []) == pytest.approx(1 / 3)
    assert success_of([2.4], [], [-0.4]) == 0.0
    assert success_of([np.nan], [], []) == 0.0


def test_the_way_counts_from_where_the_tip_was():
    goals = [Goal.of(3).with_position([0.1 * step, 0.0, 0.5]) for step in (1, 2)]
    task = Task("line", tuple(goals))
    start = np.array([[0.0, 0.0, 0.5]])
    straight = np.array([[0.1, 0.0, 0.5], [0.2, 0.0, 0.5]])
    assert way_ratio(start, straight, task) == pytest.approx(1.0)
    detour = np.array([[0.1, 0.1, 0.5], [0.2, 0.0, 0.5]])
    assert way_ratio(start, detour, task) == pytest.approx(np.sqrt(2.0))


def test_a_trembling_motion_has_more_jerk_however_long_and_wide_it_is():
    times = np.linspace(0.0, 1.0, 200)[:, None]
    smooth = 0.1 * (10 * times**3 - 15 * times**4 + 6 * times**5) * np.eye(3)[0]
    trembling = smooth + 1e-3 * np.sin(80 * times) * np.eye(3)[1]
    assert log_jerk(trembling, 0.01) > log_jerk(smooth, 0.01) + 1.0
    assert log_jerk(3.0 * smooth, 0.02) == pytest.approx(log_jerk(smooth, 0.01))


def test_the_front_holds_those_that_nobody_beats_in_both():
    points = {"slow": (9.0, 0.9), "fast": (1.0, 0.5), "beaten": (2.0, 0.4)}
    assert pareto(points) == ["slow", "fast"]
