"""`s2c2a reach`: how closely an arm at rest reaches targets."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from s2c2a.arm.geometry import name_of_end
from s2c2a.cli.console import (
    Count,
    OptionalArm,
    OptionalPath,
    SceneFile,
    Vector,
    print_table,
)
from s2c2a.cli.dependent_options import beside
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.arm import ArmSpec
    from s2c2a.goals import Goal
    from s2c2a.models.forward_model import ForwardModel
    from s2c2a.planning.reach import Reached

    Moments = tuple[np.ndarray, list[Goal]]  # times [s], and the goals at them

Obstacles = Annotated[
    tuple[tuple[float, float, float, float], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="X Y Z R"),
]


@beside("target", "axis", "module")
@beside("weights", "payload_g")
def reach(
    arm: OptionalArm = None,
    weights: OptionalPath = None,
    target: Vector = (),
    axis: Vector = (),
    module: Count = None,
    csv: OptionalPath = None,
    payload_g: float = 0.0,
    obstacle: Obstacles = (),
    scene: SceneFile = None,
    figure: Annotated[Path | None, tyro.conf.arg(name="map", metavar="PATH")] = None,
) -> None:
    """Find how closely an arm at rest reaches a target, and with which shape.

    Args:
        arm: a preset or an arm file; by default that of the weights, or twin_arm.
        weights: a file of `s2c2a train`, with the session beside it, or "shipped" for
            the networks of the package; without it, modules bend as arcs of a circle.
        target: desired position [m], base frame.
        axis: desired end axis there, base frame, of any length.
        module: number of the module whose end is meant, from 1 at the base; the last
            one by default.
        csv: a file of waypoints in place of a target, as for `run`.
        payload_g: mass at the tip [g].
        obstacle: a sphere that the arm keeps out of: center and radius [m], base frame;
            repeat for several.
        scene: a file of obstacles (docs/guides/obstacles.md), as they are at the start.
        figure: draw where the end can be, and the target, in this file (.png, .pdf or
            .svg).
    """
    from s2c2a import strategies
    from s2c2a.goals import Goal
    from s2c2a.planning.reach import Reachability
    from s2c2a.tasks.scenes import goals_beside

    spec = arm_of(arm, weights)
    path = _path(csv, spec) if csv else None
    if bool(target) == bool(csv):
        given = "both were given" if target else "none was given"
        raise S2C2AError(
            "a target is needed: a position with --target X Y Z, or a file of waypoints "
            f"with --csv; {given}"
        )
    plain = path[1] if path else [_goal(target, axis, module, spec)]
    goals = Goal.stacked(goals_beside(plain, _obstacle_rows(obstacle, scene)))
    if not 0.0 <= payload_g < np.inf:
        raise S2C2AError(
            f"--payload-g {payload_g:g} is no mass; give grams, zero or more"
        )
    if figure is not None:
        from s2c2a.viz.charts import figure_format

        figure_format(figure)  # raises an error before the search
    model = forward_model_of(weights, spec, payload_g)
    if weights is not None and (session := strategies.session_of(weights)) is not None:
        print(strategies.describe_use(session))
    reachability = Reachability(spec, model, payload_g / 1000.0)
    reached = reachability.nearest(goals)
    if path:
        _print_path(path, reached, spec)
    else:
        _print_target(plain[0], reached, spec)
    if figure is not None:
        from s2c2a.viz import reach_figure

        states = np.asarray(reachability.shapes.states)
        print(f"figure: {reach_figure(spec, states, goals, reached, figure)}")


def _goal(target: Vector, axis: Vector, module: int | None, arm: "ArmSpec") -> "Goal":
    """The goal of one target.

    Raises:
        S2C2AError: no such module, or the target is too far away for meters.
    """
    from s2c2a.tasks.lines import goal_at

    count = arm.module_count
    number = count if module is None else module
    if not 1 <= number <= count:
        raise S2C2AError(
            f"--module {number} does not exist; '{arm.name}' has {count}, from 1 at the "
            f"base to {count}"
        )
    return goal_at(arm, target, axis or None, number - 1)


def _path(csv: Path, arm: "ArmSpec") -> "Moments":
    """Moments of a file of waypoints, all control steps or evenly chosen ones.

    Raises:
        TargetError: see `load_waypoints` and `waypoints_task`.
    """
    from s2c2a.tasks import load_waypoints, waypoints_task
    from s2c2a.tasks.remarks import MOMENTS

    task = waypoints_task(csv.stem, load_waypoints(csv), arm)
    count = len(task.goals)
    steps = np.arange(0, count, -(-count // MOMENTS))
    times = (steps + 1) / arm.control_rate
    return times, [task.goals[step] for step in steps]


def _obstacle_rows(spheres: Obstacles, scene: Path | None) -> np.ndarray:
    """Rows of all obstacles (`s2c2a.obstacles`).

    Raises:
        S2C2AError: a radius is not positive, or the scene is not valid.
    """
    from s2c2a.obstacles import rows_of
    from s2c2a.tasks import load_scene

    for *_, radius in spheres:
        if not radius > 0.0:
            raise S2C2AError(
                f"--obstacle has the radius {radius:g} m, which must be positive; give "
                "X Y Z R in meters"
            )
    rows = rows_of(np.reshape(spheres, (-1, 4)))
    if scene is None:
        return rows
    return np.concatenate([rows, load_scene(scene).rows_at(np.zeros(1))[0]])


def arm_of(arm: str | None, weights: Path | None) -> "ArmSpec":
    """The arm of an option; by default that of a weight file, or `twin_arm`."""
    from s2c2a.arm import load_arm
    from s2c2a.strategies.files import stated_errors

    if arm is None and weights is not None and has_own_networks(weights):
        return stated_errors(weights)[0]
    return load_arm(arm or "twin_arm")


def has_own_networks(weights: Path | None) -> bool:
    """Whether the weights are a file, beside which a session may be."""
    from s2c2a.strategies.checkpoint import SHIPPED

    return weights is not None and str(weights) != SHIPPED


def trained_model(
    weights: Path, arm: "ArmSpec", session: str = ""
) -> "ForwardModel | None":
    """The forward model of weights on the day of a session; None if they hold none."""
    from s2c2a import strategies
    from s2c2a.models.forward_model import ForwardModel

    networks = strategies.networks_from(weights, arm, session)
    model = networks.networks.get("C2S")
    return model if isinstance(model, ForwardModel) else None


def forward_model_of(
    weights: Path | None, arm: "ArmSpec", payload_g: float = 0.0, session: str = ""
) -> "ForwardModel":
    """The forward model of weights on the day of a session; arcs where there is none.

    Raises:
        S2C2AError: it does not know payloads.
    """
    from s2c2a.models.forward_model import PCCForwardModel

    model = None if weights is None else trained_model(weights, arm, session)
    if model is None:
        lacks = f"as {weights} has no model" if weights else "without --weights"
        print(
            f"{lacks}, modules bend as arcs of a circle; real ones sag, and miss by "
            "centimeters what arcs reach"
        )
        return PCCForwardModel.of(arm)
    if payload_g and not model.takes_payload:
        raise S2C2AError(
            f"the forward model of {weights} does not depend on payloads; leave out "
            "--payload-g, or train with the recipe best"
        )
    return model


def _print_target(goal: "Goal", reached: "Reached", arm: "ArmSpec") -> None:
    """Say whether a target is reached, by how much it is missed, and by which shape."""
    from s2c2a.planning.reach import STARTS
    from s2c2a.spaces import POSITION

    module = int(np.flatnonzero(goal.position_weights)[0])
    end = f"the {name_of_end(arm, module)}"
    verdict = "reaches" if reached.within(arm.length)[0] else "does not reach"
    miss = f"misses by {_centimeters(reached.position_errors[0])}"
    if goal.axis_weights.any():
        miss += f" and {np.rad2deg(reached.axis_errors[0]):.1f} deg"
    nearest = _place(reached.states[0, module, POSITION])
    print(f"{end} {verdict} {_place(goal.positions[module])}: it {miss}")
    print(f"nearest point of {end}: {nearest}")
    std = reached.predictive_std[0]
    if std > 0.0:
        print(f"standard deviation of the tip by the model: {_centimeters(std)}")
    if np.isfinite(reached.clearances[0]):
        clearance = _centimeters(reached.clearances[0])
        print(f"clearance of the body from the obstacles: {clearance}")
    agreeing = round(STARTS * reached.agreeing[0])
    print(f"{agreeing} of {STARTS} starts of the search end as near")
    rows = []
    for number, bend in enumerate(reached.bends[0], start=1):
        size = np.rad2deg(np.hypot(*bend))
        direction = np.rad2deg(np.arctan2(bend[1], bend[0]))
        rows.append((str(number), f"{size:.1f}", f"{direction:.0f}"))
    print_table("Shape, base first", ("module", "bend deg", "toward deg"), rows)
    print("toward: from the x axis of the module's frame to its y axis")


def _print_path(path: "Moments", reached: "Reached", arm: "ArmSpec") -> None:
    """Print the parts of a path that are out of reach."""
    is_missed = ~reached.within(arm.length)
    count = len(path[0])
    if not is_missed.any():
        largest = _centimeters(reached.position_errors.max())
        print(f"all of {count} moments are within reach, missed by at most {largest}")
        return
    missed = np.flatnonzero(is_missed)
    parts = np.split(missed, np.flatnonzero(np.diff(missed) > 1) + 1)
    rows = [_part_cells(path, reached, part) for part in parts]
    print_table("Out of reach", tuple(rows[0]), [row.values() for row in rows])
    print(
        f"{is_missed.sum()} of {count} moments are out of reach, by up to "
        f"{_centimeters(reached.position_errors[is_missed].max())}"
    )


def _part_cells(
    path: "Moments", reached: "Reached", part: np.ndarray
) -> dict[str, str]:
    """Times of a part, and its largest miss."""
    times, goals = path
    errors = reached.position_errors[part]
    cells = {
        "from s": f"{times[part[0]]:.2f}",
        "to s": f"{times[part[-1]]:.2f}",
        "misses by cm": f"{100.0 * errors.max():.2f}",
        "at s": f"{times[part[errors.argmax()]]:.2f}",
    }
    if any(goal.axis_weights.any() for goal in goals):
        turns = np.rad2deg(reached.axis_errors[part])
        cells["misses by deg"] = f"{turns.max():.1f}"
    if np.isfinite(reached.clearances).all():
        clearance = 100.0 * reached.clearances[part].min()
        cells["clearance cm"] = f"{clearance:z.2f}"
    return cells


def _place(position: np.ndarray) -> str:
    return f"({', '.join(f'{coordinate:z.3f}' for coordinate in position)}) m"


def _centimeters(length: float) -> str:
    return f"{100.0 * length:z.2f} cm"
