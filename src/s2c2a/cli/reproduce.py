"""`s2c2a reproduce`: the project's tables, each from one command."""

from pathlib import Path

from tyro.extras import SubcommandApp

from s2c2a.cli.console import Arm, FidelityName, RecipeName, print_rows, print_table, progress_bar
from s2c2a.cli.crews import Address, crew_for

app = SubcommandApp()


def _tables(names: tuple[str, ...], label: str, recipe: str, seeds: int, beside, out, overwrite, crew) -> None:
    from dataclasses import asdict

    from s2c2a.experiments.following import checked_seeds
    from s2c2a.experiments.run_folder import open_run_folder
    from s2c2a.experiments.table_files import rows_beside, save_table
    from s2c2a.experiments.tables import make_table
    from s2c2a.experiments.workshop import Workshop
    from s2c2a.strategies import RECIPES, recipe_from

    numbers, chosen = checked_seeds(0, seeds), recipe_from(recipe)
    options = {"tables": names, "recipe": recipe if recipe in RECIPES else asdict(chosen), "seeds": seeds}
    folder = open_run_folder(out or Path("runs") / f"{label}-{chosen.name}", label, options, overwrite, go_on=True)
    for name in names:
        with progress_bar() as progress:
            rows, figures = make_table(name, folder, numbers, Workshop(progress=progress), chosen, crew)
        written = save_table(name, rows, folder, rows_beside(beside, name))
        print_rows(f"{name}, recipe {chosen.name}, {seeds} seeds", rows)
        print(f"table: {written} (.csv, .tex, .json beside it)")
        for figure in figures:
            print(f"figure: {figure}")


def _table_command(name: str, about: str, names: tuple[str, ...]):
    def command(
        recipe: RecipeName = "best",
        seeds: int = 5,
        beside: Path | None = None,
        out: Path | None = None,
        overwrite: bool = False,
        jobs: int | None = None,
        cluster: Address = None,
    ) -> None:
        with crew_for(jobs, cluster) as crew:
            _tables(names, name, recipe, seeds, beside, out, overwrite, crew)

    command.__name__ = name
    command.__doc__ = f"""{about}

    Cut short, it goes on where it was. Data and networks are kept in the cache (S2C2A_CACHE moves it).

    Args:
        recipe: how networks are trained and plans made.
        seeds: how many, from zero; each reseeds data, training and start.
        beside: folder of the same tables made by another recipe, to stand beside.
        out: the run folder; runs/TABLE-RECIPE if not stated.
        overwrite: begin anew.
        jobs: trainings and runs side by side; all cores if not stated. Same seeds, same rows.
        cluster: let its workers train and run. Same seeds, same rows.
    """
    return app.command(command)


ABOUT = {
    "simulation": "Table I of the simulation: ours, motor babbling, lstm, pcc, and both couplings.",
    "tracking": "Table III: circle and tilt tasks; the twin's siblings; 50 g at the tip.",
    "constraint": "Table V: one module's end stays where it is.",
    "obstacles": "Reaching past obstacles and risk levels, tip or whole arm guarded.",
    "interaction": "An obstacle and a target that move.",
    "networks": "Table II: held-out errors of both networks.",
    "workspace": "Estimation errors and workspaces of section II-D.",
}
for _name, _about in ABOUT.items():
    _table_command(_name, _about, (_name,))
_table_command("all", "All tables and figures of the paper.", tuple(ABOUT))


@app.command
def ingredients(
    seeds: int = 3,
    arm: Arm = "twin_arm",
    out: Path = Path("runs/ingredients"),
    overwrite: bool = False,
    jobs: int | None = None,
    cluster: Address = None,
) -> None:
    """What each ingredient of the recipe `best` is worth, alone and together (docs/recipe.md).

    Args:
        seeds: how many, from zero.
        arm: a preset or an arm file.
        out: the run folder; cut short, it goes on where it was.
        overwrite: begin anew.
        jobs: trainings and runs side by side; all cores if not stated.
        cluster: let its workers train and run.
    """
    from s2c2a.experiments.following import checked_seeds
    from s2c2a.experiments.ingredients import ingredient_rows
    from s2c2a.experiments.run_folder import open_run_folder
    from s2c2a.experiments.table_files import save_across
    from s2c2a.experiments.workshop import Workshop

    folder = open_run_folder(out, "ingredients", {"seeds": seeds, "arm": arm}, overwrite, go_on=True)
    with crew_for(jobs, cluster) as crew, progress_bar() as progress:
        rows = ingredient_rows(folder, checked_seeds(0, seeds), Workshop(progress=progress), arm, crew)
    print(save_across("ingredients", rows, folder).read_text(encoding="utf-8"))


@app.command
def circle(
    seeds: int = 3,
    recipe: RecipeName = "best",
    fidelity: FidelityName = "fast",
    out: Path | None = None,
    overwrite: bool = False,
    jobs: int | None = None,
    cluster: Address = None,
) -> None:
    """The circle on both arms: the paper's strategy, pcc, pcc-fitted.

    Args:
        seeds: how many, from zero; each reseeds data, training and start.
        recipe: how networks are trained and plans made.
        fidelity: of the simulation that is driven; data come from the fast one.
        out: the run folder; one with the time in its name if not stated.
        overwrite: replace the run folder if it exists.
        jobs: trainings and runs side by side; all cores if not stated.
        cluster: let its workers train and run.
    """
    from s2c2a.experiments.circle import circle_table
    from s2c2a.experiments.following import checked_seeds
    from s2c2a.experiments.run_folder import open_run_folder
    from s2c2a.experiments.workshop import Workshop

    numbers = checked_seeds(0, seeds)
    folder = open_run_folder(out, "circle", {"seeds": seeds, "recipe": recipe, "fidelity": fidelity}, overwrite)
    with crew_for(jobs, cluster) as crew, progress_bar() as progress:
        workshop = Workshop(folder / "data", progress=progress)
        table = circle_table(folder, numbers, workshop, recipe, fidelity, crew)
    print_rows(f"circle, {seeds} seeds", table.rows)
    print(f"all of it: {folder}")


@app.command
def controller(
    seeds: int = 3,
    recipe: RecipeName = "best",
    arm: Arm | None = None,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """C2A on its own, in closed loop, on references recorded while inverse PCC follows the circle at three speeds.

    Args:
        seeds: how many, from zero.
        recipe: how networks are trained.
        arm: only this one; both presets of the paper if not stated.
        out: the run folder; one with the time in its name if not stated.
        overwrite: replace the run folder if it exists.
    """
    from s2c2a.arm import load_arm
    from s2c2a.evaluation.report import save_rows
    from s2c2a.experiments.circle import ARMS
    from s2c2a.experiments.controller_tracking import SPEEDS, track_circle, tracking_rows
    from s2c2a.experiments.following import checked_seeds
    from s2c2a.experiments.run_folder import open_run_folder
    from s2c2a.experiments.workshop import Workshop
    from s2c2a.shards import compute_on_one_thread
    from s2c2a.strategies import recipe_from

    compute_on_one_thread()
    numbers, names = checked_seeds(0, seeds), (arm,) if arm else ARMS
    folder = open_run_folder(out, "controller", {"seeds": seeds, "recipe": recipe, "arms": names}, overwrite)
    rows, ends = [], []
    with progress_bar() as progress:
        workshop = Workshop(folder / "data", progress=progress)
        for name in names:
            trained = [workshop.networks(load_arm(name), recipe_from(recipe), seed) for seed in numbers]
            tracked = [[track_circle(networks, speed, networks.seed) for speed in SPEEDS] for networks in trained]
            rows += tracking_rows(tracked, trained)
            ends += [max(run[index].errors[-200:].mean() for run in tracked) for index in range(len(SPEEDS))]
    save_rows(rows, folder / "results.json")
    print_rows("C2A in closed loop, 1000 steps", rows)
    print("mean of the last 200 steps, worst seed [deg]: " + ", ".join(f"{value:.2f}" for value in ends))
    print(f"all of it: {folder}")


@app.command
def calibration(
    arm: Arm = "twin_arm",
    seeds: int = 1,
    network: bool = True,
    search: int = 0,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """The twin beside what the paper says of its arm, line by line.

    Args:
        arm: a preset or an arm file.
        seeds: how many, from zero.
        network: also train NN_C2S, for its line.
        search: first move stiffnesses and hysteresis, in so many evaluations of some seconds each.
        out: where to write the arm that the search finds; ARM-calibrated.toml if not stated.
        overwrite: replace that file if it exists.
    """
    from s2c2a.arm import load_arm, save_arm
    from s2c2a.experiments import calibration as twin
    from s2c2a.experiments.following import checked_seeds
    from s2c2a.shards import compute_on_one_thread

    compute_on_one_thread()
    spec, numbers = load_arm(arm), checked_seeds(0, seeds)
    twin.check_comparable(spec)
    if search:
        path = out or Path(f"{spec.name}-calibrated.toml")
        save_arm(spec, path, overwrite)  # what cannot be written is told before the search
        with progress_bar() as progress:
            spec = twin.search(spec, 0, search, lambda count, misfit: progress("searching", count, search))
        save_arm(spec, path, overwrite=True)
        print(f"written: {path}")
    lines = twin.lines_for(spec)
    wanted = twin.PCC_CIRCLE in lines
    measured = [twin.measure(spec, seed, wanted, network and wanted) for seed in numbers]
    mean = {name: sum(values[name] for values in measured) / seeds for name in measured[0]}
    rows = [
        (
            line.quantity,
            f"{mean[line.quantity]:.2f} {line.unit}",
            f"{line.paper:g}",
            f"± {line.tolerance:.0%}",
            _holds(line, mean),
        )
        for line in lines
        if line.quantity in mean
    ]
    rows += [
        (f"largest {name}", f"{mean[f'largest {name}']:.1f} deg", f"{top:g}", "", "reported")
        for name, top in twin.LARGEST.items()
    ]
    print_table(f"{spec.name} beside the paper's arm", ("line", "here", "paper", "tolerance", "holds"), rows)


def _holds(line, values: dict[str, float]) -> str:
    return "yes" if line.holds(values[line.quantity]) else "NO"


@app.command
def rod() -> None:
    """The simulated arm at rest against an independent rod, in five cases and both fidelities."""
    from s2c2a.experiments.simulator_accuracy import static_errors

    errors = static_errors()
    cases = dict.fromkeys(error.case for error in errors)
    by_name = {(error.case, error.fidelity): f"{1e3 * error.error:.2f}" for error in errors}
    rows = [(case, by_name[case, "fast"], by_name[case, "accurate"]) for case in cases]
    print_table("Tip error at rest [mm]", ("case", "fast", "accurate"), rows)
