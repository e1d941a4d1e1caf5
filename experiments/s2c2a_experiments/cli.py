"""Commands `s2c2a reproduce`: the project's tables."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.extras import SubcommandApp

from s2c2a.arm import ArmSpec, load_arm, save_arm
from s2c2a.cli.console import (
    Arm,
    FidelityName,
    RecipeName,
    StrategyNames,
    print_results,
    print_table,
    progress_bar,
)
from s2c2a.cli.dependent_options import beside
from s2c2a.cli.execution import ALL_CORES, NEW_FOLDER, Folder, Work, run_directory
from s2c2a_experiments import beyond_the_paper

if TYPE_CHECKING:
    from s2c2a import strategies

app = SubcommandApp()
command = app, "Reproduce the project's tables from scratch."

TABLES = {
    "simulation": "Table I: ours, motor babbling, lstm and pcc, with both couplings.",
    "tracking": "Table III: circle and tilt tasks; other arms; 50 g at the tip.",
    "constraint": "Table V: the end of one module holds its position.",
    "obstacles": "Reaching past obstacles at three risk levels, guarding tip or arm.",
    "interaction": "A moving obstacle and a moving target.",
    "paths": "Square, eight, helix and star, which need S-shaped arms.",
    "networks": "Table II: held-out errors of both networks.",
    "workspace": "Estimation errors and workspaces of section II-D.",
}


def _add_table_command(name: str, summary: str, names: tuple[str, ...]) -> None:
    def command(
        recipe: RecipeName = "best",
        strategy: StrategyNames = (),
        seeds: int = 5,
        beside: Path | None = None,
        work: Work = ALL_CORES,
    ) -> None:
        from s2c2a.strategies import RECIPES
        from s2c2a_experiments import table_files, tables

        numbers, chosen = _seeds_and_recipe(seeds, recipe)
        tables.check_strategies(names, strategy)
        options = {
            "tables": names,
            "recipe": recipe if recipe in RECIPES else asdict(chosen),
            "strategies": strategy,
            "seeds": seeds,
        }
        with run_directory(f"{name}-{chosen.name}", options, work, resume=True) as (
            directory,
            make,
        ):
            for table in names:
                # the tables of `all` that compare no strategies are made as they are
                is_compared = len(names) == 1 or table in tables.TABLES
                added = strategy if is_compared else ()
                rows, figures = tables.make_table(
                    table, directory, numbers, make, chosen, added
                )
                compared = table_files.load_comparison(beside, table)
                path = table_files.save_table(table, rows, directory, compared)
                title = f"{table}, recipe {chosen.name}, {seeds} seeds"
                print_results(title, rows, figures, directory)
                print(f"table: {path} (.csv, .tex, .json next to it)")

    command.__name__ = name
    command.__doc__ = f"""{summary}

    Data and networks are kept in the cache (the environment variable S2C2A_CACHE moves
    it). Repeat the command to continue an interrupted run.

    Args:
        recipe: training of the networks and planning.
        strategy: further strategies to compare, by name or your own file.py:Class.
        seeds: number of seeds, from zero; each sets data, training and start.
        beside: run directory of the same tables with another recipe, to compare with.
        work: run directory and parallel execution.
    """
    app.command(command)


def _seeds_and_recipe(
    seeds: int, recipe: str = "best"
) -> "tuple[range, strategies.Recipe]":
    from s2c2a import jobs, strategies

    return jobs.checked_seeds(0, seeds), strategies.recipe_from(recipe)


for _name, _summary in TABLES.items():
    _add_table_command(_name, _summary, (_name,))
_add_table_command(
    "all",
    "All tables and figures of the paper.",
    tuple(name for name in TABLES if name != "paths"),
)


@app.command
def ingredients(seeds: int = 3, arm: Arm = "twin_arm", work: Work = ALL_CORES) -> None:
    """Ablation study of the recipe `best`: each part alone, and all (docs/concepts/recipe.md).

    Repeat the command to continue an interrupted run.

    Args:
        seeds: number of seeds, from zero.
        arm: a preset or an arm file.
        work: run directory and parallel execution.
    """
    from s2c2a_experiments.table_files import save_across
    from s2c2a_experiments.tables import ablation_rows

    numbers, _ = _seeds_and_recipe(seeds)
    options = {"seeds": seeds, "arm": arm}
    with run_directory("ingredients", options, work, resume=True) as (directory, make):
        rows = ablation_rows(numbers, make, arm)
    print(save_across("ingredients", rows, directory).read_text(encoding="utf-8"))


app.command(name="randomised-arms")(beyond_the_paper.randomized_arms)
app.command(beyond_the_paper.sensors)
app.command(beyond_the_paper.stability)
app.command(beyond_the_paper.motion)
app.command(beyond_the_paper.scenes)
app.command(beyond_the_paper.shapes)
app.command(beyond_the_paper.reach)
app.command(beyond_the_paper.repetition)
app.command(beyond_the_paper.session)
app.command(beyond_the_paper.data)
app.command(beyond_the_paper.sensor_faults)
app.command(beyond_the_paper.payloads)
app.command(beyond_the_paper.real)
app.command(name="open-loop")(beyond_the_paper.open_loop)
app.command(beyond_the_paper.plans)


@app.command
def circle(
    seeds: int = 3,
    recipe: RecipeName = "best",
    fidelity: FidelityName = "fast",
    work: Work = ALL_CORES,
) -> None:
    """The circle on both arms: the paper's strategy, pcc and pcc-fitted.

    Args:
        seeds: number of seeds, from zero; each sets data, training and start.
        recipe: training of the networks and planning.
        fidelity: of the simulation in the runs; the data come from the fast one.
        work: run directory and parallel execution.
    """
    from s2c2a.jobs.circle import circle_table

    numbers, chosen = _seeds_and_recipe(seeds, recipe)
    options = {"seeds": seeds, "recipe": recipe, "fidelity": fidelity}
    with run_directory("circle", options, work, own_data=True) as (directory, make):
        rows, pictures = circle_table(directory, numbers, make, chosen, fidelity)
    print_results(f"circle, {seeds} seeds", rows, pictures, directory)


@app.command
def controller(
    seeds: int = 3,
    recipe: RecipeName = "best",
    arm: Arm | None = None,
    folder: Folder = NEW_FOLDER,
) -> None:
    """The controller C2A alone, in closed loop, on recorded reference configurations.

    The references are recorded while inverse PCC follows the circle at three speeds.

    Args:
        seeds: number of seeds, from zero.
        recipe: training of the networks.
        arm: only this one; by default both presets of the paper.
        folder: run directory.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a.jobs.circle import ARMS
    from s2c2a_experiments.circle import controller_table

    names = (arm,) if arm else ARMS
    numbers, chosen = _seeds_and_recipe(seeds, recipe)
    options = {"seeds": seeds, "recipe": recipe, "arms": names}
    with run_directory("controller", options, folder, own_data=True) as (
        directory,
        make,
    ):
        arms = [load_arm(name) for name in names]
        rows, final_errors = controller_table(arms, numbers, make, chosen)
    save_rows(rows, directory / "results.json")
    print_results("C2A in closed loop, 1000 steps", rows, [], directory)
    print(
        "mean of the last 200 steps, worst seed [deg]: "
        + ", ".join(f"{error:.2f}" for error in final_errors)
    )


@app.command
@beside("search", "out", "overwrite")
def calibration(
    arm: Arm = "twin_arm",
    seeds: int = 1,
    network: bool = True,
    search: int = 0,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Properties of the simulated arm compared with those that the paper reports.

    Args:
        arm: a preset or an arm file.
        seeds: number of seeds, from zero.
        network: train NN_C2S too, for its error.
        search: first optimize stiffnesses and hysteresis, with so many evaluations of
            some seconds each.
        out: file of the optimized arm; ARM-calibrated.toml by default.
        overwrite: replace that file if it exists.
    """
    from s2c2a.execution.executors import limit_jax_to_one_thread
    from s2c2a_experiments import calibration as study

    limit_jax_to_one_thread()
    spec = load_arm(arm)
    numbers, _ = _seeds_and_recipe(seeds)
    study.check_comparable(spec)
    if search:
        path = out or Path(f"{spec.name}-calibrated.toml")
        spec = _calibrated(spec, search, path, overwrite)
    measured = study.mean_measurements(spec, numbers, network)
    rows = [
        _claim_cells(claim, measured[claim.quantity])
        for claim in study.claims_for(spec)
        if measured.get(claim.quantity) is not None
    ]
    for name, claim in zip(("I", "II", "III"), study.LARGEST, strict=True):
        value = f"{measured[claim.quantity]:.1f} deg"
        rows.append((f"largest {name}", value, f"{claim.paper:g}", "", "reported"))
    header = ("quantity", "measured", "paper", "tolerance", "within")
    print_table(f"{spec.name} compared with the paper's arm", header, rows)


def _calibrated(arm: ArmSpec, evaluations: int, path: Path, overwrite: bool) -> ArmSpec:
    from s2c2a_experiments.calibration import search

    # a file that cannot be written is reported before the search
    save_arm(arm, path, overwrite)
    with progress_bar() as progress:

        def on_evaluation(count: int, misfit: float) -> None:
            progress("searching", count, evaluations)

        calibrated = search(arm, 0, evaluations, on_evaluation)
    save_arm(calibrated, path, overwrite=True)
    print(f"arm: {path}")
    return calibrated


def _claim_cells(claim, value: float) -> tuple[str, ...]:
    return (
        claim.quantity,
        f"{value:.2f} {claim.unit}",
        f"{claim.paper:g}",
        f"± {claim.tolerance:.0%}",
        "yes" if claim.holds(value) else "NO",
    )
