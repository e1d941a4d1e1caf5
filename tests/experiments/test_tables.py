"""What tables are made of, how runs are kept, and how tables look as files."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.evaluation.report import Row
from s2c2a.jobs import Run, jobs_for
from s2c2a.jobs.rows import score_rows
from s2c2a.kinematics import PCC, configurations_from_bends, states_from_bends
from s2c2a.strategies import STRATEGIES, recipe_named
from s2c2a.tasks import TASKS
from s2c2a_experiments import tables
from s2c2a_experiments.run_rows import metric_rows, tick_rows
from s2c2a_experiments.table_files import (
    load_comparison,
    load_rows,
    markdown_escaped,
    markdown_table,
    save_table,
)
from s2c2a_experiments.tables import (
    TABLES,
    actuation_coupled,
    make_table,
    mean_rows,
    sensing_coupled,
)
from s2c2a_experiments.workspace import estimation_errors_deg, sensing_rows

TWIN, SIMULATED = load_arm("twin_arm"), load_arm("simulated_arm")
ROW = Row(
    experiment="tracking",
    task="circle",
    arm="twin_arm",
    fidelity="fast",
    strategy="s2c2a",
    recipe="best",
    metric="position",
    unit="cm",
    mean=0.514,
    std_steps=0.25,
    std_seeds=0.1,
    seeds=(0, 1),
    paper_mean=2.2,
    paper_std=1.1,
    first_mode_hz=1.234,
    damping_ratio=0.05,
)
OTHER = replace(
    ROW,
    experiment="tracking, 50 g & #2",
    task="100%_way",
    strategy="pcc",
    mean=3.0,
    std_steps=None,
    std_seeds=None,
    paper_mean=None,
    paper_std=None,
)


def test_coupled_sensors_mix_all_modules_as_equation_11_says():
    arm = sensing_coupled(SIMULATED)
    assert arm.name == "simulated_arm_sensing_coupled"
    assert np.shape(arm.sensing_coupling) == (3, 3)
    (difference,) = arm.differences(SIMULATED)
    assert difference.startswith("sensing_coupling ((0.85")


def test_sensing_coupling_is_refused_for_an_arm_of_two_modules(make_arm):
    with pytest.raises(ArmError, match="'test_arm' has 2 modules"):
        sensing_coupled(make_arm(2))


def test_coupled_cables_pull_with_half_the_tension():
    arm = actuation_coupled(SIMULATED)
    assert arm.name == "simulated_arm_actuation_coupled"
    assert arm.coupled_cables
    keys = {text.split()[0] for text in arm.differences(SIMULATED)}
    changed = {"pretension", "tension_range"}
    of_modules = {f"modules.{number}.{key}" for number in range(3) for key in changed}
    assert keys == {"coupled_cables", *of_modules}
    for coupled, alone in zip(arm.modules, SIMULATED.modules, strict=True):
        assert coupled.pretension == pytest.approx(alone.pretension / 2)
        assert coupled.tension_range == pytest.approx(alone.tension_range / 2)
        changed = {"pretension": alone.pretension, "tension_range": alone.tension_range}
        assert coupled.model_copy(update=changed) == alone


def test_every_task_and_strategy_of_a_table_exists():
    blocks = [block for table in TABLES.values() for block in table]
    assert {task for block in blocks for task in block.tasks} <= set(TASKS)
    for strategy in {name for block in blocks for name in block.strategies}:
        assert STRATEGIES.find(strategy)


def test_rows_of_a_table_can_be_told_apart():
    """No task of a strategy stands twice on one arm under one heading."""
    for table in TABLES.values():
        runs = [
            (block.arm().name, block.label, task, strategy)
            for block in table
            for task in block.tasks
            for strategy in block.strategies
        ]
        assert len(set(runs)) == len(runs)


def test_a_table_without_strategies_refuses_further_ones(tmp_path):
    with pytest.raises(S2C2AError, match="compares no strategies"):
        make_table("networks", tmp_path, [0], list, recipe_named("best"), ["lstm"])


def test_every_task_has_a_figure_with_all_strategies(monkeypatch, tmp_path):
    monkeypatch.setattr(tables, "trace_of", lambda run: run.strategy)
    monkeypatch.setattr(tables, "run_figure", lambda *drawn: drawn)
    jobs = jobs_for(
        ["circle", "tilt-50"], TWIN, ["s2c2a", "pcc"], [0], recipe_named("best")
    )
    runs = [Run(job, None, []) for job in jobs]
    figures = tables._draw(runs, "50 g at the tip", tmp_path)
    assert [(traces, path.name) for traces, _, path, _ in figures] == [
        (["s2c2a", "pcc"], f"figure-twin_arm-{task}-50-g-at-the-tip.png")
        for task in ("circle", "tilt-50")
    ]


def test_means_over_tilt_tasks_are_those_worked_by_hand():
    numbers = {
        "tilt-40": (1.0, 0.2, 2.0),
        "tilt-50": (2.0, 0.4, 3.0),
        "tilt-0": (6.0, 0.6, None),
    }
    rows = [
        replace(
            ROW, task=task, mean=mean, std_steps=steps, paper_mean=paper, paper_std=1.0
        )
        for task, (mean, steps, paper) in numbers.items()
    ]
    tilts = [
        replace(rows[0], metric="tilt", unit="deg", mean=9.0),
        replace(rows[0], strategy="pcc", mean=8.0),
    ]
    means = mean_rows([*rows, *tilts, replace(ROW, mean=100.0)])
    found = {(row.strategy, row.metric): row for row in means}
    assert set(found) == {("s2c2a", "position"), ("s2c2a", "tilt"), ("pcc", "position")}
    mean = found["s2c2a", "position"]
    assert (mean.task, mean.mean) == ("mean of 3 tilt tasks", pytest.approx(3.0))
    assert mean.std_steps == pytest.approx(0.4)
    assert (mean.paper_mean, mean.paper_std, mean.std_seeds) == (None, 1.0, None)
    assert found["s2c2a", "tilt"].mean == 9.0
    assert found["pcc", "position"].mean == 8.0


def test_markdown_names_recipes_seeds_and_first_modes(tmp_path):
    path = save_table(
        "tracking",
        [ROW, OTHER],
        tmp_path / "new",
        [replace(ROW, mean=1.0, recipe="paper")],
    )
    text = path.read_text(encoding="utf-8").splitlines()
    assert path == tmp_path / "new" / "tracking.md"
    assert text[0] == "# tracking, recipe `best`, seeds 0, 1"
    assert (
        text[2] == "| task | metric | strategy | `best` | ± seeds | `paper` | paper |"
    )
    assert text[4].startswith(
        "| twin_arm: circle | position [cm] | s2c2a "
        "| 0.51 ± 0.25 | 0.10 | 1.00 ± 0.25 | 2.20 ± 1.10 |"
    )
    assert len({line.count("|") for line in text if line.startswith("|")}) == 1
    assert text[-1] == "twin_arm: first bending mode 1.23 Hz, damping ratio 0.05."


def test_names_show_as_they_are_in_every_kind_of_table():
    name = r"`a|b` $x^2$ {\~} <i>"
    assert markdown_table(["x"], [[name]]).splitlines()[2] == (
        r"| `a\|b` $x^2$ {\~} <i> |"
    )
    assert markdown_escaped(name) == r"`a|b` $x^2$ {\\~} \<i\>"


def test_what_never_recovers_comes_back_from_strict_json(tmp_path):
    never = replace(OTHER, mean=float("inf"), std_steps=None)
    save_table("tracking", [never], tmp_path)
    written = json.loads(
        (tmp_path / "tracking.json").read_text(),
        parse_constant=lambda word: pytest.fail(word),
    )
    assert written[0]["mean"] == "inf"
    assert load_rows(tmp_path / "tracking.json") == [never]
    save_table("tracking", [ROW, OTHER], tmp_path)
    assert load_comparison(tmp_path, "tracking") == [ROW, OTHER]
    assert load_comparison(tmp_path, "constraint") == []
    assert load_comparison(None, "tracking") == []


def test_rows_hold_means_over_seeds_and_the_papers_numbers_beside():
    jobs = jobs_for(["circle"], TWIN, ["s2c2a"], [0, 2], recipe_named("best"))
    columns = {
        "time": np.arange(2.0),
        "actions": np.zeros((2, 3, 3)),
        "tick_time": np.array([0.001, 0.003]),
    }
    episode = Episode(TWIN, columns)
    scored = {"score": SimpleNamespace(metric="position"), "unit": "cm"}
    runs = []
    for job, value in zip(jobs, (1.0, 2.0), strict=True):
        values = {"value": value, "values": np.array([value]), "averaged": True}
        runs.append(Run(job, episode, [SimpleNamespace(**scored, **values)]))
    (row,) = score_rows("mine", runs)
    assert (row.strategy, row.mean, row.seeds) == ("s2c2a", 1.5, (0, 2))
    assert row.std_seeds == pytest.approx(0.5**0.5)
    assert (row.paper_mean, row.recipe, row.fidelity) == (2.2, "best", "fast")
    assert row.first_mode_hz > 0
    (labeled,) = metric_rows("mine", runs, "imu, 50 g", {("position", "cm"): [1, 2]})
    assert (labeled.strategy, labeled.mean) == ("imu, 50 g", 1.5)
    assert labeled.paper_mean is None
    ticks = {row.metric: row.mean for row in tick_rows("mine", runs)}
    expected = {"tick, median": 2.0, "tick, 99th percentile": 3.0}
    assert ticks == pytest.approx(expected)


def off_by(shift_deg, seed=0) -> Recording:
    """A recording whose true bends are the sensed ones plus a constant angle."""
    random = np.random.default_rng(seed)
    bends = random.uniform(-0.2, 0.2, (2, 20, 3, 2))
    bends[..., 1] = 0.0
    cables = np.asarray(PCC.of(TWIN).actions(bends))
    shift = np.stack([np.deg2rad(shift_deg), 0.0 * np.asarray(shift_deg)], axis=-1)
    columns = {
        "time": np.tile(np.arange(20) / 10, (2, 1)),
        "actions": cables,
        "sensor.cables": cables,
        "sensor.states": states_from_bends(bends, np.full(3, 0.2, np.float32)),
        "sensor.configurations": configurations_from_bends(bends + shift),
    }
    episodes = [
        Episode(TWIN, {name: np.asarray(said[one]) for name, said in columns.items()})
        for one in range(2)
    ]
    return Recording(TWIN, {"episodes": 2}, tuple(episodes))


def test_estimation_errors_are_angles_between_sensed_and_true_configurations():
    errors = estimation_errors_deg(off_by(np.array([2.0, 0.0, -5.0])))
    assert errors.shape == (2, 20, 3)
    np.testing.assert_allclose(
        errors, np.broadcast_to([2.0, 0.0, 5.0], errors.shape), atol=0.02
    )


def test_sensing_rows_hold_both_workspaces_and_every_modules_errors():
    asked = []

    def make(artifacts):
        asked.extend(one.options for one in artifacts)
        seeds = [one.options.seed for one in artifacts]
        return [off_by(np.array([2.0, 3.0, 4.0]) + seed, seed) for seed in seeds]

    recipe = recipe_named("best")
    rows, first = sensing_rows(TWIN, [0, 2], make, recipe)
    np.testing.assert_array_equal(first.actions, off_by(0.0).actions)
    assert [one.babbling for one in asked] == ["staged", "staged", "motor", "motor"]
    assert {one.speeds for one in asked} == {recipe.speeds}
    found = {(row.strategy, row.metric): row for row in rows}
    assert len(found) == len(rows) == 6 + 6
    width = [np.ptp(off_by(0.0, seed).sensor("states")[:, :, -1, 0]) for seed in (0, 2)]
    assert found["staged babbling", "workspace x"].mean == pytest.approx(np.mean(width))
    assert found["motor babbling", "workspace z"].paper_mean == 0.34
    largest = found["sensors", "estimation error III, largest"]
    assert largest.mean == pytest.approx(5.0, abs=0.02)
    assert (largest.unit, largest.paper_mean) == ("deg", 36.3)
    assert largest.std_seeds == pytest.approx(np.sqrt(2.0), abs=0.02)
