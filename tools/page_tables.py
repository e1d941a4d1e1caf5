"""The tables on the pages: which rows of `results/` each one shows."""

import csv
from collections.abc import Callable, Sequence
from typing import Any

from s2c2a.tasks import registry

from tools.markdown import table
from tools.results_tables import (
    MISSING,
    RESULTS,
    Column,
    Line,
    find_row,
    find_rows,
    number,
    table_of,
    three_digits,
    with_spread,
)

TABLES: dict[str, Callable[[], str]] = {}
"""Functions that make a table, by its name on the pages."""

TILTS = "mean of 6 tilt tasks"
PAYLOADS_G = (0, 50, 100)
PACES = ("circle", "square", "eight", "circle@0.5", "square@0.5", "eight@0.5")


def shown_as(name: str) -> Callable[[Callable[[], str]], Callable[[], str]]:
    """Register a function that makes the table of this name."""

    def registered(make: Callable[[], str]) -> Callable[[], str]:
        TABLES[name] = make
        return make

    return registered


def paper_value(row: dict[str, Any]) -> str:
    """What the paper reports for its arm."""
    return number(row["paper_mean"], 1)


def _columns() -> list[Column]:
    """Strategies of the tables of the paper, and the paper's own values."""
    networks = {"arm": "twin_arm", "strategy": "s2c2a"}
    return [
        Column("`best`", "best", networks),
        Column("`paper`", "paper", networks),
        Column("`pcc-fitted`", "best", {**networks, "strategy": "pcc-fitted"}),
        Column("`pcc`", "best", {**networks, "strategy": "pcc"}),
        Column("the paper's arm", "best", networks, paper_value),
    ]


def _line(label: str, file: str, task: str, *metrics: str, **match: str) -> Line:
    """A line of one task; its experiment is the name of the file unless stated."""
    fields = {"table": file, "experiment": file, "task": task, **match}
    return Line(label, metrics, fields)


MAIN_LINES = (
    _line("`circle` [cm]", "tracking", "circle", "position"),
    _line("six tilt tasks [cm; deg]", "tracking", TILTS, "position", "tilt"),
    _line(
        "`hold-base`: constraint; position [cm]",
        "constraint",
        "hold-base",
        "constraint",
        "position",
    ),
    _line(
        "`hold-middle` [cm; deg]",
        "constraint",
        "hold-middle",
        "constraint",
        "orientation",
    ),
    _line(
        "`hold-end` [cm; deg]", "constraint", "hold-end", "constraint", "orientation"
    ),
    _line("moving target, `follow` [cm]", "interaction", "follow", "position"),
    _line("smallest clearance, `flee` [cm]", "interaction", "flee", "clearance"),
)


@shown_as("main")
def main_table() -> str:
    """Tasks of the paper on `twin_arm`."""
    return table_of(MAIN_LINES, _columns())


@shown_as("summary")
def summary_table() -> str:
    """One line for each question of the page of results."""
    strategies = ("best", "paper", "pcc-fitted", "pcc")
    label = "`circle`, `twin_arm` [cm]"
    circle = _line(label, "tracking", "circle", "position")
    lines = [[label, *(circle.cell(column) for column in _columns())]]
    for degree, file in STRENGTHS:
        cells = [mean_value(file, "circle", "position", name) for name in strategies]
        label = f"`circle`, arms with {degree} mismatch [cm]"
        lines.append([label, *(number(value) for value in cells), MISSING])
    rest = [MISSING] * 4
    seen = with_spread(sensor_row("imu", 50))
    lines.append(["`circle`, 50 g unknown, inertial sensors [cm]", seen, *rest])
    fast = {"task": "circle, 5 s a turn", "metric": "position"}
    for file, title in zip(MOTION_FILES, ("`twin_arm`", "mild mismatch"), strict=True):
        means = [row["mean"] for row in find_rows(file, **fast)]
        mean = number(sum(means) / len(means))
        lines.append([f"circle of 5 s, {title} [cm]", mean, *rest])
    for title, tips in real_tips().items():
        errors = [three_digits(tips.get(name)) for name in strategies]
        lines.append([f"recording {title} [mm]", *errors, MISSING])
    return table(["", *(column.title for column in _columns())], lines)


@shown_as("tilts")
def tilts_table() -> str:
    """Every tilt task on `twin_arm`."""
    lines = [
        _line(f"`{task}` [cm; deg]", "tracking", task, "position", "tilt")
        for task in registry.TILTS
    ]
    azimuths = "mean of 2 tilt tasks"
    lines.append(
        _line("azimuth of the last two [deg]", "tracking", azimuths, "azimuth")
    )
    return table_of(lines, _columns())


@shown_as("hysteresis")
def hysteresis_table() -> str:
    """Arms with other hysteresis."""
    other = "tracking, other hysteresis"
    lines = []
    for arm in ("twin_capstan", "twin_creep", "twin_both"):
        for label, task, metrics in (
            ("circle [cm]", "circle", ("position",)),
            ("six tilt tasks [cm; deg]", TILTS, ("position", "tilt")),
        ):
            title = f"`{arm}`, {label}"
            lines.append(
                _line(title, "tracking", task, *metrics, experiment=other, arm=arm)
            )
    columns = [
        Column("`best`", "best", {"strategy": "s2c2a"}),
        Column("`paper`", "paper", {"strategy": "s2c2a"}),
    ]
    return table_of(lines, columns)


@shown_as("simulated-arm")
def simulated_arm_table() -> str:
    """The circle of the arm with tension control."""
    names = {
        "s2c2a": "S2C2A",
        "s2c2a-motor": "S2C2A, motor babbling",
        "lstm": "LSTM",
        "pcc": "PCC",
        "pcc-fitted": "PCC, fitted gains",
    }
    fields = ("experiment", "arm", "task", "strategy", "metric")
    lines = []
    for ours in find_rows("best/simulation.json", metric="position"):
        match = {name: ours[name] for name in fields}
        paper = find_rows("paper/simulation.json", **match)
        of_paper = with_spread(paper[0]) if paper else MISSING
        strategy = names.get(ours["strategy"], ours["strategy"])
        label = f"`{ours['arm']}`, {strategy}"
        lines.append([label, with_spread(ours), of_paper, paper_value(ours)])
    return table(["`circle` [cm]", "`best`", "`paper`", "the paper's arm"], lines)


@shown_as("first-run")
def first_run_table() -> str:
    """The circle of `twin_arm`, as in the demo."""
    strategies = ("s2c2a", "pcc", "pcc-fitted")
    match = {"experiment": "tracking", "arm": "twin_arm", "task": "circle"}
    rows = [
        find_row("best/tracking.json", strategy=name, metric="position", **match)
        for name in strategies
    ]
    line = ["`twin_arm`", *map(with_spread, rows), paper_value(rows[0])]
    return table(["arm", *(f"`{name}`" for name in strategies), "paper"], [line])


OBSTACLE_TASKS = ("reach-0", "reach-1", "reach-2", "risk-a", "risk-b", "risk-c")


@shown_as("obstacles")
def obstacles_table() -> str:
    """Clearances and path lengths past obstacles."""
    tip = ("reached", "clearance", "path length")
    arm = ("reached", "clearance of the arm", "path length")
    lines = []
    for label, experiment, metrics in (
        ("tip guarded", "obstacles", tip),
        ("whole arm guarded", "obstacles, whole arm guarded", arm),
    ):
        for task in OBSTACLE_TASKS:
            match = {"experiment": experiment, "task": task}
            if not find_rows("best/obstacles.json", **match):
                continue
            cells = [f"`{task}`, {label}"]
            for folder in ("best", "paper"):
                cells += [_obstacle_cell(folder, metric, match) for metric in metrics]
            lines.append(cells)
    head = ["", "reached", "clearance [cm]", "path length [cm]"]
    return table([*head, *(f"`paper`: {title}" for title in head[1:])], lines)


def _obstacle_cell(folder: str, metric: str, match: dict[str, str]) -> str:
    rows = find_rows(
        f"{folder}/obstacles.json", metric=metric, strategy="s2c2a", **match
    )
    if not rows:
        return MISSING
    if metric == "reached":
        return f"{rows[0]['mean']:.0%}"
    return with_spread(rows[0])


@shown_as("networks")
def networks_table() -> str:
    """Held-out errors of the networks."""
    lines = []
    for row in find_rows("best/networks.json"):
        match = {name: row[name] for name in ("arm", "task", "metric", "strategy")}
        paper = find_row("paper/networks.json", **match)
        label = f"`{row['arm']}`, {row['strategy']}: {row['metric']} [{row['unit']}]"
        lines.append([label, with_spread(row), with_spread(paper), paper_value(row)])
    return table(["", "`best`", "`paper`", "the paper's arm"], lines)


@shown_as("calibration")
def calibration_table() -> str:
    """Lines of `twin_arm` to which its file was calibrated."""
    lines = [
        [
            f"{row['metric']} [{row['unit']}]",
            number(row["mean"]),
            number(row["paper_mean"]),
        ]
        for row in find_rows("paper/workspace.json", arm="twin_arm", task="data")
        if row["strategy"] != "motor babbling"
    ]
    return table(["line", "`twin_arm`", "the paper's arm"], lines)


ABLATION = (
    _line("`circle` [cm]", "ingredients", "circle", "position"),
    _line("`tilt-60` [cm; deg]", "ingredients", "tilt-60", "position", "tilt"),
    _line("`tilt-0` [cm; deg]", "ingredients", "tilt-0", "position", "tilt"),
    _line(
        "`hold-middle` [cm; deg]",
        "ingredients",
        "hold-middle",
        "constraint",
        "orientation",
    ),
)


@shown_as("ablation")
def ablation_table() -> str:
    """Errors of the recipes with one part removed or replaced, one a line."""
    file = "ingredients/ingredients.json"
    strategies = dict.fromkeys(row["strategy"] for row in find_rows(file))
    lines = []
    for strategy in strategies:
        column = Column("", "ingredients", {"strategy": strategy})
        lines.append([strategy, *(line.cell(column) for line in ABLATION)])
    return table(["", *(line.label for line in ABLATION)], lines)


@shown_as("paths")
def paths_table() -> str:
    """Paths that need an S shape."""
    lines = [
        Line(
            f"`{task}` [cm]",
            ("position",),
            {"table": "paths", "task": task, "arm": "twin_arm"},
        )
        for task in ("square", "eight", "helix", "star")
    ]
    columns = [
        Column("`best`", "paths", {"strategy": "s2c2a"}),
        Column("`pcc-fitted`", "paths", {"strategy": "pcc-fitted"}),
        Column("`pcc`", "paths", {"strategy": "pcc"}),
    ]
    return table_of(lines, columns)


STRENGTHS = (
    ("mild", "randomised-arms/randomised-arms.json"),
    ("strong", "randomised-arms-strong/randomised-arms.json"),
)
"""Mismatch of randomized arms, and the file of their rows."""
RANDOMIZED = (
    ("circle", "position"),
    (TILTS, "position"),
    (TILTS, "tilt"),
    ("hold-middle", "constraint"),
    ("hold-middle", "orientation"),
    ("held", "distance"),
    ("held", "distance, largest"),
    ("held", "runaways"),
    ("beyond", "distance, largest"),
)


@shown_as("randomized")
def randomized_table() -> str:
    """Mean of the arms, and the worst one in brackets."""
    strategies = ("best", "best-long", "paper", "pcc-fitted", "pcc")
    lines = []
    for degree, file in STRENGTHS:
        for task, metric in RANDOMIZED:
            cells = []
            for strategy in strategies:
                match = {"task": task, "metric": metric, "strategy": strategy}
                mean = _mean_row(file, "mean", match)
                worst = _mean_row(file, "worst", match)
                if mean is None or worst is None:
                    cells.append(MISSING)
                    continue
                unit = mean["unit"]
                cells.append(f"{number(mean['mean'])} ({number(worst['mean'])})")
            lines.append([f"{degree}, {task}: {metric} [{unit}]", *cells])
    return table(["mismatch, task", *(f"`{name}`" for name in strategies)], lines)


def _mean_row(file: str, which: str, match: dict[str, str]) -> dict[str, Any] | None:
    """The row of the mean or the worst of all arms."""
    for row in find_rows(file, **match):
        if row["arm"].startswith(f"{which} of"):
            return row
    return None


@shown_as("paces")
def paces_table() -> str:
    """Paths at two paces on randomized arms."""
    lines = []
    folders = {"0.5": "randomised-arms-paths", "1.0": "randomised-arms-paths-strong"}
    for strength, folder in folders.items():
        file = f"{folder}/randomised-arms.json"
        for metric, unit in (
            ("position", " [cm]"),
            ("errors within twice the std", ""),
        ):
            cells = [number(mean_value(file, task, metric, "best")) for task in PACES]
            label = f"strength {strength}, `best`: {metric}{unit}"
            lines.append([label, *cells])
    return table(["", *(f"`{task}`" for task in PACES)], lines)


def mean_value(file: str, task: str, metric: str, strategy: str) -> float | None:
    match = {"task": task, "metric": metric, "strategy": strategy}
    row = _mean_row(file, "mean", match)
    return None if row is None else row["mean"]


@shown_as("sensors")
def sensors_table() -> str:
    """The circle with unknown payloads, by sensors."""
    names = {
        "encoders": "encoders only",
        "encoders-known-payload": "encoders, `--known-payload`",
        "imu": "inertial sensors, `[sensors.imu]`",
        "current": "motor currents, `motor.current_noise`",
        "camera": "camera that sees the tip, `[sensors.camera]`",
        "motion-capture": 'motion capture, `sees = "ends"`',
        "bends": "true bends, `[sensors] bends`",
        "flex": "flex sensors, `[sensors.flex]`",
        "imu-current-camera": "inertial sensors, currents and camera",
    }
    lines = []
    for sensors, label in names.items():
        cells = [with_spread(sensor_row(sensors, payload)) for payload in PAYLOADS_G]
        lines.append([label, *cells])
    return table(["sensors", "no payload", "50 g", "100 g"], lines)


def sensor_row(sensors: str, payload: int) -> dict[str, Any]:
    """The circle of `twin_arm` with a set of sensors and a payload [g]."""
    return find_row(
        "sensors/results.json",
        task="circle",
        strategy=f"{sensors}, {payload} g",
        metric="position",
    )


@shown_as("choosing")
def choosing_table() -> str:
    """Which strategy to use, with its error on the circle."""
    lines = [
        [
            "15 minutes of motion with known module ends (simulation, tracking, a log)",
            "`s2c2a` with `best`, the default",
            _circle("best", "s2c2a"),
        ],
        [
            "cables that become slack, and an hour",
            "`s2c2a` with `best-long`",
            f"{_strong_mismatch('best-long')} instead of {_strong_mismatch('best')} "
            "(three arms with strong mismatch)",
        ],
        ["no tracking and no log", "`--strategy pcc`", _circle("best", "pcc")],
        [
            "the same, in a clone; cables not coupled",
            "`--strategy pseudo-rigid` if weight and stiffness are known, else `diff-ik`",
            "[compared](../results/planners.md#results)",
        ],
        [
            "nothing or 50 s recorded, and time for simulations; cables coupled or not",
            "a [prior](transfer.md)",
            "between that of `pcc` and of `best`",
        ],
        [
            "a need to explain every parameter, and data",
            "`--strategy pcc-fitted`",
            _circle("best", "pcc-fitted"),
        ],
        [
            "the wish to compare with the paper",
            "`--recipe paper`",
            _circle("paper", "s2c2a"),
        ],
    ]
    return table(
        ["if you have", "then use", "error on the circle of `twin_arm` [cm]"], lines
    )


def _circle(folder: str, strategy: str) -> str:
    row = find_row(
        f"{folder}/tracking.json",
        experiment="tracking",
        arm="twin_arm",
        task="circle",
        strategy=strategy,
        metric="position",
    )
    return number(row["mean"])


def _strong_mismatch(recipe: str) -> str:
    file = "randomised-arms-strong/randomised-arms.json"
    return number(mean_value(file, "circle", "position", recipe))


REAL_FILES = ("opencr_v4", "stanford_trunk")
REAL_SCORES = {
    "log likelihood": "log likelihood [nats]",
    "coverage": "coverage",
    "rank correlation": "rank correlation",
}


REAL_TITLES = {"blocks": "between its rows", "largest": "beyond its pulls"}
"""What held-out rows of a recording are, by the first word of their name."""


def real_tips() -> dict[str, dict[str, float]]:
    """Mean distances of the tip [mm] by held-out rows and model."""
    tips: dict[str, dict[str, float]] = {}
    for file in REAL_FILES:
        for row in find_rows(f"{file}/real.json", metric="tip"):
            tips.setdefault(held_out(row), {})[row["strategy"]] = row["mean"]
    return tips


def held_out(row: dict[str, Any]) -> str:
    """Recording and held-out rows of a row; other sessions are named by their files."""
    arm, _, split = row["task"].partition(", ")
    return f"`{arm}`, {REAL_TITLES.get(split.split()[0], 'another session')}"


@shown_as("real-tips")
def real_tips_table() -> str:
    """Tips of models on recordings of real arms."""
    tips = real_tips()
    models = list(next(iter(tips.values())))
    lines = [
        [title, *(three_digits(line[model]) for model in models)]
        for title, line in tips.items()
    ]
    return table(["tip [mm]", *(f"`{model}`" for model in models)], lines)


@shown_as("real")
def real_table() -> str:
    """What models on recordings of real arms say of their errors."""
    rows = [
        row
        for file in REAL_FILES
        for row in find_rows(f"{file}/real.json")
        if row["metric"] in REAL_SCORES
    ]
    models = list(dict.fromkeys(row["strategy"] for row in rows))
    means: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        line = means.setdefault((held_out(row), row["metric"]), {})
        line[row["strategy"]] = row["mean"]
    lines = [
        [title, REAL_SCORES[metric], *(three_digits(line.get(each)) for each in models)]
        for (title, metric), line in means.items()
    ]
    return table(["held out", "score", *models], lines)


@shown_as("payloads")
def payloads_table() -> str:
    """Payloads of a real arm: tip error without and with estimation."""
    file = "payloads/results.json"
    strategies = list(dict.fromkeys(row["strategy"] for row in find_rows(file)))
    tasks = list(dict.fromkeys(row["task"] for row in find_rows(file)))
    lines = []
    for strategy in strategies:
        found = [
            find_row(file, task=task, strategy=strategy, metric="position")["mean"]
            for task in tasks
        ]
        lines.append([f"tip error, {strategy} [mm]", *(number(v, 1) for v in found)])
    masses = [
        find_row(file, task=task, strategy="estimated", metric="payload")["mean"]
        for task in tasks
    ]
    lines.append(["estimated payload [g]", *(number(mass, 0) for mass in masses)])
    names = {"full": "no payload", "100g": "100 g", "300g": "300 g"}
    return table(["", *(names.get(task, task) for task in tasks)], lines)


MOTION_FILES = ("motion/results.json", "motion-randomised/results.json")


TURNS = ("16 s", "8 s", "5 s", "3 s")
PATHS = ("square", "eight", "helix", "star")
MOVING_ARMS = ("twin_arm", "twin_arm_50_0", "twin_arm_50_1")
UNTOUCHED = "no point deeper than 2 mm"
MOVING_TASKS = (*(f"circle, {turn} a turn" for turn in TURNS), *PATHS)


def moving_error(arm: str, task: str) -> float:
    """Mean error of the tip in motion [cm]."""
    return _in_motion(arm, task, "position")


def _in_motion(arm: str, task: str, metric: str) -> float:
    """A value of an arm with encoders alone and no payload."""
    file = MOTION_FILES[arm != "twin_arm"]
    match = {"arm": arm, "task": task, "strategy": "encoders, 0 g"}
    return find_row(file, metric=metric, **match)["mean"]


@shown_as("motion")
def motion_table() -> str:
    """Paths at several speeds: way of the tip, and smoothness of plans."""
    metrics = ("further way", "planned bends above 0.3 Hz", "plan stands")
    lines = []
    for task in (*MOVING_TASKS, "square@0.5", "follow"):
        cells = []
        for arm in MOVING_ARMS:
            further, fast, stands = (_in_motion(arm, task, name) for name in metrics)
            cells.append(
                f"{number(further, 0)} / {number(fast, 1)} / {number(stands, 0)}"
            )
        lines.append([task, *cells])
    return table(["", *(f"`{arm}`" for arm in MOVING_ARMS)], lines)


@shown_as("limits")
def limits_table() -> str:
    """How fast, how far, around what."""
    lines = [
        [f"{task} [cm]", *(number(moving_error(arm, task)) for arm in MOVING_ARMS)]
        for task in MOVING_TASKS
    ]
    jump = find_row(
        MOTION_FILES[0], strategy="encoders, 0 g", metric="until within 1 cm"
    )
    lines.append(
        [
            "jump by 20 cm: within 1 cm after [s]",
            number(jump["mean"], 1),
            MISSING,
            MISSING,
        ]
    )
    agree = [
        find_rows("reach/results.json", arm=arm, task="all", metric="verdicts agree")
        for arm in MOVING_ARMS
    ]
    shares = [f"{100 * rows[0]['mean']:.1f}" if rows else MISSING for rows in agree]
    lines.append(["verdicts of `reach` that a long search shares [%]", *shares])
    for task in ("drawn scenes", "crossing spheres"):
        for metric, says in (("reached", "target reached"), ("untouched", UNTOUCHED)):
            row = find_row("scenes/results.json", task=task, metric=metric)
            lines.append(
                [
                    f"{task}: {says} [% of runs]",
                    f"{100 * row['mean']:.0f}",
                    MISSING,
                    MISSING,
                ]
            )
    return table(["", *(f"`{arm}`" for arm in MOVING_ARMS)], lines)


@shown_as("jumps")
def jumps_table() -> str:
    """Jumps of the target: time and overshoot."""
    file = MOTION_FILES[0]
    lines = []
    for row in find_rows(file, task="steps", metric="overshoot"):
        match = {name: row[name] for name in ("arm", "task", "strategy")}
        time = find_row(file, metric="until within 1 cm", **match)
        cells = [number(row["mean"], 1), number(time["mean"], 1)]
        lines.append([f"`{row['arm']}`, {row['strategy']}", *cells])
    return table(["target jumps", "overshoot [cm]", "within 1 cm after [s]"], lines)


@shown_as("scene-shares")
def scene_shares_table() -> str:
    """Drawn scenes and crossing spheres: shares of runs."""
    file = "scenes/results.json"
    lines = []
    for row in find_rows(file, metric="reached"):
        untouched = find_row(file, task=row["task"], metric="untouched")["mean"]
        smallest = find_row(
            file, task=row["task"], metric="smallest clearance of the arm"
        )
        lines.append(
            [
                row["task"],
                f"{100 * row['mean']:.0f}%",
                f"{100 * untouched:.0f}%",
                number(smallest["mean"], 2),
            ]
        )
    turned = [
        row["mean"]
        for row in find_rows(file, metric="clearance of the arm")
        if "turned" in row["task"]
    ]
    least = number(min(turned), 2)
    lines.append(["turned tasks, means of the seeds", MISSING, MISSING, least])
    header = ["scenes", "reached within 1 cm", UNTOUCHED]
    return table([*header, "smallest clearance [cm]"], lines)


@shown_as("no-way")
def no_way_table() -> str:
    """Shares of runs whose plan says that there is no way."""
    file = "scenes/results.json"
    lines = []
    for row in find_rows(file, metric="said unreachable within 2 s"):
        end = find_row(file, task=row["task"], metric="said unreachable at the end")
        shares = [f"{100 * value['mean']:.0f}%" for value in (row, end)]
        lines.append([row["task"], *shares])
    return table(["scenes", "said within 2 s", "said at the end"], lines)


@shown_as("reach")
def reach_table() -> str:
    """Searches for reachable poses beside a long search."""
    file = "reach/results.json"
    lines = []
    for row in find_rows(file, metric="verdicts agree"):
        match = {name: row[name] for name in ("arm", "task", "strategy")}
        missed, farther = (
            find_row(file, metric=metric, **match)["mean"]
            for metric in (
                "reached by the long search alone",
                "farther, 99th percentile",
            )
        )
        shares = [f"{100 * share:.1f}%" for share in (row["mean"], missed)]
        heading = [f"`{row['arm']}`, {row['strategy']}", row["task"]]
        lines.append([*heading, *shares, number(farther, 2)])
    header = ["arm, forward model", "poses", "verdicts agree"]
    header += ["reached by the long search alone", "farther, 99th percentile [cm]"]
    return table(header, lines)


@shown_as("shapes")
def shapes_table() -> str:
    """Distances of the center line from curves for the whole arm."""
    file = "shapes/results.json"
    metrics = ("shape", "shape, largest", "end distance", "best fit")
    lines = []
    for row in find_rows(file, metric="shape"):
        match = {name: row[name] for name in ("arm", "task", "strategy")}
        rows = [find_row(file, metric=metric, **match) for metric in metrics]
        heading = [f"`{row['arm']}`", row["task"], f"`{row['strategy']}`"]
        lines.append([*heading, *(number(one["mean"], 2) for one in rows)])
    header = ["arm", "curves", "strategy", "distance [cm]", "largest [cm]"]
    return table([*header, "tip [cm]", "best fit [cm]"], lines)


@shown_as("stability")
def stability_table() -> str:
    """Motion and error of the tip at a held point."""
    file = "stability/results.json"
    arms = list(dict.fromkeys(row["arm"] for row in find_rows(file)))
    payloads = (0, 50, 100, 150)
    lines = []
    for arm in arms:
        for sensors in ("encoders-known-payload", "bends", "imu", "current", "camera"):
            cells = []
            for payload in payloads:
                match = {"arm": arm, "strategy": f"{sensors}, {payload} g"}
                worst = []
                for metric in (
                    "peak to peak, last two thirds",
                    "position, last quarter",
                ):
                    rows = find_rows(file, metric=metric, **match)
                    held = [row["mean"] for row in rows if row["task"] != "circle"]
                    worst.append(number(max(held), 1))
                cells.append(" / ".join(worst))
            lines.append([f"`{arm}`, {sensors}", *cells])
    return table(["", *(f"{payload} g" for payload in payloads)], lines)


@shown_as("session")
def session_table() -> str:
    """An arm on another day, without and with a session: circle and other motion."""
    file = "session/results.json"
    rows = find_rows(file)
    improved = [row for row in rows if row["metric"] == "improves"]
    changes = dict.fromkeys(row["strategy"].split(",")[0] for row in improved)
    lines = []
    for arm in dict.fromkeys(row["arm"] for row in rows):
        for change in changes:
            cells = []
            for metric, digits in (("position", 2), ("model error", 1), ("warns", 0)):
                pair = []
                for session in ("without", "with"):
                    name = f"{change}, {session} session"
                    row = find_row(file, arm=arm, strategy=name, metric=metric)
                    pair.append(number(row["mean"], digits))
                cells.append(" / ".join(pair))
            lines.append([f"`{arm}`", change, *cells])
    return table(
        ["arm", "change", "circle [cm]", "other motion [mm]", "warns [runs]"], lines
    )


@shown_as("session-days")
def drawn_days_table() -> str:
    """How often drawn changes are within two stated deviations of the truth [%]."""
    rows = find_rows("session/results.json", strategy="drawn days")
    shares: dict[str, dict[str, str]] = {}
    for row in rows:
        part = row["metric"].removesuffix(" within two std")
        shares.setdefault(row["arm"], {})[part] = number(100 * row["mean"], 0)
    parts = next(iter(shares.values()))
    lines = [[f"`{arm}`", *own.values()] for arm, own in shares.items()]
    return table(["within two deviations [%]", *parts], lines)


@shown_as("repetition")
def repetition_table() -> str:
    """Iterative learning: whole run, and its last quarter."""
    file = "repetition/results.json"
    arms = list(dict.fromkeys(row["arm"] for row in find_rows(file)))
    lines = []
    for label, strategy in (
        ("first", "camera, repetition 1"),
        ("fifth", "camera, repetition 5"),
    ):
        cells = []
        for arm in arms:
            match = {"arm": arm, "strategy": strategy}
            whole = find_row(file, metric="position", **match)
            last = find_row(file, metric="position, last quarter", **match)
            cells.append(f"{number(whole['mean'])} ({number(last['mean'])})")
        lines.append([label, *cells])
    for label in ("encoders, turn 3", "camera, turn 3"):
        rows = [find_row(file, arm=arm, strategy=label) for arm in arms]
        lines.append([label, *(number(row["mean"]) for row in rows)])
    return table(["repetition [cm]", *(f"`{arm}`" for arm in arms)], lines)


FAULTS = {
    "healthy": "none",
    "drift": "drift",
    "latency": "latency of 2 s",
    "noise": "noise, 20 times the usual one",
    "offset": "offset",
    "negated": "sign inverted",
    "zeros": "zeros",
    "frozen": "frozen",
    "reversed": "modules swapped",
}


@shown_as("sensor-faults")
def sensor_faults_table() -> str:
    """Largest tip error after a fault, and time until the sensor is rejected."""
    file = "sensor-faults/results.json"
    lines = []
    for fault, label in FAULTS.items():
        cells = []
        for sensor in ("encoders", "bends", "imu", "current", "camera"):
            case = fault if fault == "healthy" else f"{fault}, to the end"
            strategy = f"{sensor}, {case}"
            worst = find_row(file, strategy=strategy, metric="worst error")["mean"]
            times = find_rows(file, strategy=strategy, metric="time to rejection")
            if fault == "healthy":
                cells.append(number(worst, 1))
            else:
                time = number(times[0]["mean"], 1) if times else MISSING
                cells.append(f"{number(worst, 1)} / {time}")
        lines.append([label, *cells])
    head = [
        "fault",
        "encoders",
        "bends",
        "inertial sensors",
        "motor currents",
        "camera",
    ]
    return table(head, lines)


@shown_as("planners")
def planners_table() -> str:
    """What planners achieve: success, and errors by task."""
    columns = [
        "entrant",
        "success",
        "held out",
        "path",
        "orientation",
        "constraint",
        "obstacles",
        "moving target",
        "payload",
        "known payload",
    ]
    return _csv_table("planners.csv", columns)


@shown_as("planners-motion")
def planners_motion_table() -> str:
    """How planners move the arm, and what they cost."""
    step = "step, median; 99 % [ms]"
    columns = ["entrant", "settling [s]", step]
    return _csv_table("planners.csv", columns)


@shown_as("planners-by-arm")
def planners_by_arm_table() -> str:
    """Success of planners on each arm."""
    return _csv_table("by-arm.csv")


def _csv_table(name: str, columns: Sequence[str] = ()) -> str:
    """Columns of a table of `results/planners/`, all by default, shares in percent."""
    text = (RESULTS / "planners" / name).read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    chosen = columns or list(rows[0])
    cells = [[row[column].replace(" %", "") for column in chosen] for row in rows]
    return table(chosen, cells)


PERFORMANCE = {
    "control step": "bench_step: tick[best-free]",
    "control step, two obstacles": "bench_step: tick[best-past two obstacles]",
    "control step, two obstacles, the whole arm guarded": "bench_step: "
    "tick[best-past them, whole arm guarded]",
    "control step, `paper`": "bench_step: tick[paper-free]",
    "plan": "bench_plan: plan[best]",
    "plan, `paper`": "bench_plan: plan[paper]",
    "the core at best: product of two matrices": "bench_plan: matrix_product",
    "ten plans, `paper`": "bench_plan: ten_plans_beside_eager_pytorch",
    "plans for 4096 arms": "bench_batch: batch[best-4096]",
    "control step at 100 Hz": "bench_jitter: ticks_on_time",
    "10,000 control steps": "bench_jitter: memory_over_ticks",
    "a first start": "bench_startup: first_tick[best-first]",
    "a later start": "bench_startup: first_tick[best-later]",
    "`s2c2a --help`": "bench_startup: help",
    "9000 samples": "bench_collect: 9000_samples",
    "training": "bench_training: train[best]",
    "training, `paper`": "bench_training: train[paper]",
    "simulation, `fast`": "bench_simulation: simulate[fast-one thread]",
    "simulation, `accurate`": "bench_simulation: simulate[accurate-one thread]",
}
"""What is timed -> row of `results/performance/`; the recipe is `best` unless stated."""


@shown_as("performance")
def performance_table() -> str:
    """Times, and what the benchmarks state beside them."""
    lines = []
    for label, name in PERFORMANCE.items():
        row = find_row("performance/times.json", benchmark=name)
        beside = [
            f"{key} {three_digits(value) if isinstance(value, float) else value}"
            for key, value in row["beside"].items()
        ]
        times = [_time(row["median"]), _time(row["tail"])]
        lines.append([label, *times, ", ".join(beside), f"`{name.split(':')[0]}.py`"])
    return table(["", "median", "99 %", "beside it", "file"], lines)


def _time(milliseconds: float | None) -> str:
    if milliseconds is None:
        return MISSING
    if milliseconds < 1000.0:
        return f"{three_digits(milliseconds)} ms"
    return f"{three_digits(milliseconds / 1000.0)} s"
