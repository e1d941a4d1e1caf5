"""`s2c2a demo`, and `s2c2a reproduce`: the project's tables, each from one command."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.extras import SubcommandApp

from s2c2a.arm import load_arm, save_arm
from s2c2a.cli import experiments
from s2c2a.cli.console import (
    Arm,
    FidelityName,
    RecipeName,
    print_results,
    print_table,
    progress_bar,
)
from s2c2a.cli.execution import ALL_CORES, NEW_FOLDER, Folder, Work, making

if TYPE_CHECKING:
    from s2c2a import strategies

app = SubcommandApp()

ABOUT = {
    "simulation": "Table I of the simulation: ours, motor babbling, lstm, pcc, and both couplings.",
    "tracking": "Table III: circle and tilt tasks; the twin's siblings; 50 g at the tip.",
    "constraint": "Table V: one module's end stays where it is.",
    "obstacles": "Reaching past obstacles and risk levels, tip or whole arm guarded.",
    "interaction": "An obstacle and a target that move.",
    "paths": "Square, eight, helix and star, on which the arm has to make an S.",
    "networks": "Table II: held-out errors of both networks.",
    "workspace": "Estimation errors and workspaces of section II-D.",
}


def _table_command(name: str, about: str, names: tuple[str, ...]) -> None:
    def command(
        recipe: RecipeName = "best",
        seeds: int = 5,
        beside: Path | None = None,
        work: Work = ALL_CORES,
    ) -> None:
        from s2c2a.evaluation import report
        from s2c2a.strategies import RECIPES
        from s2c2a.studies import tables

        numbers, chosen = _given(seeds, recipe)
        options = {
            "tables": names,
            "recipe": recipe if recipe in RECIPES else asdict(chosen),
            "seeds": seeds,
        }
        with making(f"{name}-{chosen.name}", options, work, go_on=True) as (
            place,
            make,
        ):
            for table in names:
                rows, figures = tables.make_table(table, place, numbers, make, chosen)
                written = report.save_table(
                    table, rows, place, report.rows_beside(beside, table)
                )
                print_results(
                    f"{table}, recipe {chosen.name}, {seeds} seeds",
                    rows,
                    figures,
                    place,
                )
                print(f"table: {written} (.csv, .tex, .json beside it)")

    command.__name__ = name
    command.__doc__ = f"""{about}

    Cut short, it goes on where it was. Data and networks are kept in the cache (S2C2A_CACHE moves it).

    Args:
        recipe: how networks are trained and plans made.
        seeds: how many, from zero; each reseeds data, training and start.
        beside: folder of the same tables made by another recipe, to stand beside.
        work: where results go, and who works.
    """
    app.command(command)


def _given(seeds: int, recipe: str = "best") -> "tuple[range, strategies.Recipe]":
    """So many seeds from zero, and the recipe."""
    from s2c2a import jobs, strategies

    return jobs.checked_seeds(0, seeds), strategies.recipe_from(recipe)


for _name, _about in ABOUT.items():
    _table_command(_name, _about, (_name,))
_table_command(
    "all",
    "All tables and figures of the paper.",
    tuple(name for name in ABOUT if name != "paths"),
)


@app.command
def ingredients(seeds: int = 3, arm: Arm = "twin_arm", work: Work = ALL_CORES) -> None:
    """What each ingredient of the recipe `best` is worth, alone and together (docs/recipe.md).

    Cut short, it goes on where it was.

    Args:
        seeds: how many, from zero.
        arm: a preset or an arm file.
        work: where results go, and who works.
    """
    from s2c2a.evaluation.report import save_across
    from s2c2a.studies.tables import ingredient_rows

    numbers, _ = _given(seeds)
    with making("ingredients", {"seeds": seeds, "arm": arm}, work, go_on=True) as (
        place,
        make,
    ):
        rows = ingredient_rows(numbers, make, arm)
    print(save_across("ingredients", rows, place).read_text(encoding="utf-8"))


app.command(name="randomised-arms")(experiments.randomized_arms)
for _verb in (experiments.sensors, experiments.loads, experiments.transfer, experiments.real, experiments.plans):
    app.command(_verb)


@app.command
def circle(
    seeds: int = 3,
    recipe: RecipeName = "best",
    fidelity: FidelityName = "fast",
    work: Work = ALL_CORES,
) -> None:
    """The circle on both arms: the paper's strategy, pcc, pcc-fitted.

    Args:
        seeds: how many, from zero; each reseeds data, training and start.
        recipe: how networks are trained and plans made.
        fidelity: of the simulation that is driven; data come from the fast one.
        work: where results go, and who works.
    """
    from s2c2a.studies.circle import circle_table

    numbers, chosen = _given(seeds, recipe)
    options = {"seeds": seeds, "recipe": recipe, "fidelity": fidelity}
    with making("circle", options, work, own_data=True) as (place, make):
        rows, pictures = circle_table(place, numbers, make, chosen, fidelity)
    print_results(f"circle, {seeds} seeds", rows, pictures, place)


def demo(seed: int = 0, folder: Folder = NEW_FOLDER) -> None:
    """Run the whole pipeline on both simulated arms: collect, train, follow a circle, compare with the paper.

    Args:
        seed: of everything random.
        folder: where results go.
    """
    from s2c2a.studies.circle import circle_table

    with making("demo", {"seed": seed}, folder, own_data=True) as (place, make):
        rows, pictures = circle_table(place, [seed], make, _given(1)[1])
    print_results("Following a circle: ours and the paper's", rows, pictures, place)


@app.command
def controller(
    seeds: int = 3,
    recipe: RecipeName = "best",
    arm: Arm | None = None,
    folder: Folder = NEW_FOLDER,
) -> None:
    """C2A on its own, in closed loop, on references recorded while inverse PCC follows the circle at three speeds.

    Args:
        seeds: how many, from zero.
        recipe: how networks are trained.
        arm: only this one; both presets of the paper if not stated.
        folder: where results go.
    """
    from s2c2a.evaluation.report import save_rows
    from s2c2a.studies.circle import ARMS, tracking_table

    names = (arm,) if arm else ARMS
    (numbers, chosen) = _given(seeds, recipe)
    options = {"seeds": seeds, "recipe": recipe, "arms": names}
    with making("controller", options, folder, own_data=True) as (place, make):
        rows, ends = tracking_table(
            [load_arm(name) for name in names], numbers, make, chosen
        )
    save_rows(rows, place / "results.json")
    print_results("C2A in closed loop, 1000 steps", rows, [], place)
    print(
        "mean of the last 200 steps, worst seed [deg]: "
        + ", ".join(f"{value:.2f}" for value in ends)
    )


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
        search: first move stiffnesses and hysteresis, in so many evaluations of some
            seconds each.
        out: where to write the arm that the search finds; ARM-calibrated.toml if not
            stated.
        overwrite: replace that file if it exists.
    """
    from s2c2a.executors import compute_on_one_thread
    from s2c2a.studies import calibration as studied

    compute_on_one_thread()
    spec = load_arm(arm)
    (numbers, _) = _given(seeds)
    studied.check_comparable(spec)
    if search:
        written = out or Path(f"{spec.name}-calibrated.toml")
        # what cannot be written is told before the search
        save_arm(spec, written, overwrite)
        with progress_bar() as progress:
            spec = studied.search(
                spec,
                0,
                search,
                lambda count, misfit: progress("searching", count, search),
            )
        save_arm(spec, written, overwrite=True)
        print(f"written: {written}")
    mean = studied.mean_measured(spec, numbers, network)
    rows = []
    for claim in studied.claims_for(spec):
        if (value := mean.get(claim.quantity)) is not None:
            held = f"± {claim.tolerance:.0%}", "yes" if claim.holds(value) else "NO"
            rows.append(
                (claim.quantity, f"{value:.2f} {claim.unit}", f"{claim.paper:g}", *held)
            )
    for name, claim in zip(("I", "II", "III"), studied.LARGEST, strict=True):
        rows.append(
            (
                f"largest {name}",
                f"{mean[claim.quantity]:.1f} deg",
                f"{claim.paper:g}",
                "",
                "reported",
            )
        )
    print_table(
        f"{spec.name} beside the paper's arm",
        ("line", "here", "paper", "tolerance", "holds"),
        rows,
    )
