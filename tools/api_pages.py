"""Opening, example and packages of each page of the Python API.

The examples are complete programs and run one after the other in one folder.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Page:
    """A page of the Python API.

    Attributes:
        file: name of the file.
        title: heading.
        packages: packages and modules whose public names the page describes.
        purpose: what they are for, for the list of all pages.
        text: opening paragraph.
        example: short program.
        more: paths of further names, of packages that export none.
    """

    file: str
    title: str
    packages: tuple[str, ...]
    purpose: str
    text: str
    example: str
    more: tuple[str, ...] = ()


INTERNAL = {
    "cli": "the command line: Commands",
    "emulation": "emulated devices: s2c2a emulate",
    "identification": "system identification: s2c2a identify",
    "live": "the page in the browser: s2c2a live and s2c2a view",
    "studies": "experiments behind the results: s2c2a reproduce",
}
"""Packages behind a command, without a page."""

PAGES = (
    Page(
        "arm.md",
        "Arm",
        ("s2c2a.arm",),
        "description of an arm, in Python or from an arm file",
        """
An `ArmSpec` holds every parameter of an arm: modules, cables, motors, sensors, limits.
It is frozen, and validated when it is built. `load_arm` reads a preset or an arm file;
[Arm file](../arm-file.md) explains all fields, which have the same names and defaults in
Python. `ArmGeometry` holds the arrays that follow from it.
""",
        """
from s2c2a.arm import load_arm, save_arm

arm = load_arm("twin_arm")  # a preset, or the path of an arm file
print(arm.module_count, arm.cable_count, arm.length)
slow_arm = arm.model_copy(update={"name": "slow_arm", "step_limit_deg": 2.0})
save_arm(slow_arm, "slow_arm.toml", overwrite=True)
""",
    ),
    Page(
        "kinematics.md",
        "Spaces and kinematics",
        ("s2c2a.spaces", "s2c2a.kinematics"),
        "States, Configurations, bends and Actions, and the maps between them",
        """
`s2c2a.spaces` defines the arrays that robots, planner and controller exchange.
`s2c2a.kinematics` maps them onto each other, with modules of constant curvature. All
maps are pure JAX functions: batched, differentiable and compilable. [State,
Configuration, Action](../../concepts/spaces.md) explains the spaces.
""",
        """
import numpy as np

from s2c2a.kinematics import configurations_from_bends, states_from_bends

bends = np.array([[0.5, 0.0], [0.0, 0.3], [-0.2, 0.2]])  # rad, shape (modules, 2)
print(configurations_from_bends(bends))  # unit vectors, shape (modules, 3)
print(states_from_bends(bends, np.full(3, 0.2)))  # ends and axes, shape (modules, 6)
""",
    ),
    Page(
        "robots.md",
        "Robots",
        ("s2c2a.robots", "s2c2a.robots.simulation"),
        "the interface of every arm, and the simulated arm",
        """
A `Robot` is an arm that takes actions and returns readings, simulated or real.
`SimulatedRobot` runs in MuJoCo with a clock of its own. `check_robot` tests a class of
yours against the interface contract; [Your robot and your own
parts](../../guides/extending.md) shows how to write one.
""",
        """
from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.robots.simulation import SimulatedRobot

arm = load_arm("twin_arm")
with SimulatedRobot(arm, seed=0) as robot:  # opens it, closes it at the end
    robot.send(ArmGeometry.of(arm).action_neutral)
    robot.advance(arm.control_period)
    print(robot.read()["states"][-1, :3])  # position of the tip [m], base frame
""",
    ),
    Page(
        "data.md",
        "Data and episodes",
        ("s2c2a.data", "s2c2a.episodes"),
        "collection of recordings, and the files of all episodes",
        """
`collect` drives a robot with random motion (babbling) and writes a `Recording`: episodes
of one arm for training. An `Episode` holds arrays with one row for each control step;
[Episode columns](../episodes.md) lists them. Runs are episodes, too.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions, collect
from s2c2a.robots.simulation import SimulatedRobot

arm = load_arm("twin_arm")
options = CollectOptions(episodes=2, samples=50)
recording = collect(
    "short.episodes", arm, lambda seed: SimulatedRobot(arm, seed=seed), options
)
print(recording.sensors, recording.actions.shape)
""",
    ),
    Page(
        "models.md",
        "Models",
        ("s2c2a.models", "s2c2a.training"),
        "learned forward models (C2S) and controllers (C2A), and their training",
        """
A forward model predicts the State from the Configuration; a controller C2A chooses the
Action. Options classes build and train them, and [recipe files](../recipe.md) name these
classes. `s2c2a.training` holds the training loop. [The recipe
best](../../concepts/recipe.md) explains the models.
""",
        """
import jax

from s2c2a.arm import load_arm
from s2c2a.models import C2SOptions

arm = load_arm("twin_arm")
model = C2SOptions(layers=2, hidden=16).untrained(arm, jax.random.key(0))
sensed = jax.numpy.tile(jax.numpy.array([0.0, 0.0, 1.0]), (3, 1))  # a straight arm
print(model.predict(sensed, model.start(sensed)))  # State, shape (modules, 6)
""",
    ),
    Page(
        "estimation.md",
        "Estimation",
        ("s2c2a.estimation",),
        "state estimators: Configuration, payload and bend biases from readings",
        """
A `StateEstimator` turns readings into an `Estimate`, from which planner and controller
start. `EncoderOnly` uses the encoders alone, `KalmanFilter` also inertial sensors,
cameras, motor currents and flex sensors. [State estimation](../../concepts/estimation.md)
explains the filter.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.estimation import EncoderEstimator, configuration_map_for
from s2c2a.robots.simulation import SimulatedRobot

arm = load_arm("twin_arm")
with SimulatedRobot(arm) as robot:
    estimate = EncoderEstimator(configuration_map_for(arm)).start(robot.read())
print(estimate.configuration, estimate.payload)
""",
    ),
    Page(
        "planning.md",
        "Planning",
        ("s2c2a.planning",),
        "the planner S2C: from the desired State to the Configuration",
        """
The planner searches for the Configuration whose predicted State is nearest to a `Goal`.
`PlannerOptions` names its solver, terms, guides and fallback; `PAPER` and `BEST` are the
options of the two recipes. [Planning](../../concepts/planning.md) explains the objective.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.planning import Goal

goal = Goal.of(load_arm("twin_arm").module_count)
goal = goal.with_position([0.1, 0.05, 0.55]).with_axis([0.0, 0.0, 1.0])  # of the tip
goal = goal.with_obstacles([[0.2, 0.0, 0.5]], [0.05])  # centers, thresholds [m]
print(goal.positions, goal.thresholds[:1])
""",
    ),
    Page(
        "control.md",
        "Control",
        ("s2c2a.control",),
        "controllers C2A: from the desired Configuration to the Action",
        """
A `Controller` chooses the next action from the planned and the sensed Configuration.
`NetworkController` applies the learned C2A, `InversePCC` inverts constant-curvature arcs
without feedback. A controller is a pure function with an explicit memory, so that one
compiled call serves every step.
""",
        """
import jax.numpy as jnp

from s2c2a.arm import load_arm
from s2c2a.control import InversePCC
from s2c2a.kinematics import PCC, configurations_from_bends

controller = InversePCC(PCC.of(load_arm("twin_arm")), jnp.ones(3))
desired = configurations_from_bends(jnp.array([[0.4, 0.0], [0.0, 0.2], [0.0, 0.0]]))
action, memory = controller.act(desired, desired, controller.start(desired))
print(action)  # m, shape (modules, cables)
""",
    ),
    Page(
        "strategies.md",
        "Strategies",
        ("s2c2a.strategies",),
        "state estimator, planner and controller together; recipes and weight files",
        """
A `Strategy` combines a state estimator, a planner and a controller for one arm.
`train_s2c2a` trains the networks of a [recipe](../recipe.md) on a recording,
`s2c2a_strategy` builds the strategy from them. `shipped_networks` holds trained networks
of the presets.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.strategies import recipe_named, shipped_networks

networks = shipped_networks(load_arm("twin_arm"))
print(networks.recipe.name, networks.arm.name)
print(recipe_named("paper").planner.terms)
""",
    ),
    Page(
        "tasks.md",
        "Tasks",
        ("s2c2a.tasks",),
        "goals for every control step, and the scores of a run",
        """
A `Task` is one `Goal` for every control step and the scores of a run. `load_task` finds a
task by name, in a waypoint file or in your code; [Your first
task](../../get-started/first-task.md) writes one. [Protocol](../../results/protocol.md)
defines the tasks of the paper.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.tasks import TASKS, load_task

task = load_task("circle", load_arm("twin_arm"))
print(len(TASKS), len(task.goals))
print(task.desired_positions()[0, -1])  # of the tip in the first step [m], base frame
""",
    ),
    Page(
        "evaluation.md",
        "Evaluation",
        ("s2c2a.evaluation",),
        "runs of strategies on tasks, their scores and reports",
        """
`rollout` runs a strategy on a task with any robot and returns the `Episode`. `score_run`
computes the scores of the task; the functions `describe_...` write the sentences that
`run` prints. [Protocol](../../results/protocol.md) defines the metrics.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.evaluation import rollout, score_run
from s2c2a.planning import PAPER
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import load_task

arm = load_arm("twin_arm")
task = load_task("circle", arm)
run = rollout(SimulatedRobot(arm), pcc_strategy(arm, PAPER), task)
for row in score_run(run, task, recipe="paper"):
    print(row.score.metric, row.value, row.unit)
""",
    ),
    Page(
        "runtime.md",
        "Runtime",
        ("s2c2a.runtime",),
        "the control loop: clock, stages, limits and checks",
        """
A `Loop` connects a robot and a controller. In every step it checks the reading, asks the
controller for an action, limits its value, rate and acceleration, and sends it. At the
end it moves a real arm to rest. [Safety](../../concepts/safety.md) explains the stages.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.runtime import CommandLimits, Patience

arm = load_arm("twin_arm")
limits = CommandLimits.of(arm)
print(limits.step_limit, limits.acceleration_limit)  # rad, shape (modules, 1)
print(Patience.of(arm.control_rate, unsound=1.0, alone=10.0))
""",
    ),
    Page(
        "tracking.md",
        "Tracking",
        ("s2c2a.lab.tracking",),
        "poses of module ends from motion capture or cameras",
        """
A `Tracker` returns the poses of rigid bodies; `tracker_of` builds one from a source such
as `udp:9763`. `TrackedRobot` adds the States that follow from them to the readings of a
real arm. [Pose tracking](../../guides/tracking.md) shows how to set up and calibrate one.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.lab.tracking import ModuleEnds, UdpTracker

print(ModuleEnds.of_arm(load_arm("twin_arm")).bodies)
with UdpTracker(port=0) as tracker:  # any free port
    print(tracker.address, tracker.latest(), tracker.problem)
""",
    ),
    Page(
        "hardware.md",
        "Hardware",
        ("s2c2a.lab.hardware",),
        "real arms: servo buses, calibration, bring-up, and the robot above them",
        """
`DynamixelRobot` and `FeetechRobot` are robots of bus servos that wind the cables of an
arm; the table `[servos]` of the arm file describes them. `BringUp` does what
`s2c2a motors` offers: find servos, home and check cables. Import the names from the
modules that their headings state. [Real arms with bus servos](../../guides/hardware.md)
leads from parts to a circle.
""",
        """
from s2c2a.arm import load_arm, servos_of
from s2c2a.lab.hardware.calibration import default_path
from s2c2a.lab.hardware.servo_robot import DynamixelRobot

arm = load_arm("twin_arm")
print(servos_of(arm).ids)  # one row a module
if default_path(arm).is_file():  # the calibration that `s2c2a motors home` writes
    robot = DynamixelRobot(arm, port="/dev/ttyUSB0")
""",
        (
            "s2c2a.lab.hardware.servo_robot.ServoRobot",
            "s2c2a.lab.hardware.servo_robot.DynamixelRobot",
            "s2c2a.lab.hardware.servo_robot.FeetechRobot",
            "s2c2a.lab.hardware.buses.open_bus",
            "s2c2a.lab.hardware.bus.ServoBus",
            "s2c2a.lab.hardware.bus.ServoInfo",
            "s2c2a.lab.hardware.bus.ServoState",
            "s2c2a.lab.hardware.bring_up.BringUp",
            "s2c2a.lab.hardware.bring_up.CableCheck",
            "s2c2a.lab.hardware.calibration.Calibration",
            "s2c2a.lab.hardware.calibration.CalibratedServo",
            "s2c2a.lab.hardware.calibration.load_calibration",
            "s2c2a.lab.hardware.calibration.save_calibration",
            "s2c2a.lab.hardware.timing.measure_timing",
        ),
    ),
    Page(
        "viz.md",
        "Visualization",
        ("s2c2a.viz",),
        "figures, replay pages and videos of arms and runs",
        """
All drawings are made from States, so simulated, real and recorded arms look alike. A
`Trace` is a run to draw. `replay_page` writes an interactive page, `run_figure` a figure
of several runs, `arm_figure` a drawing of an arm to scale.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.viz import arm_figure

path = arm_figure(load_arm("twin_arm"), "twin_arm.png")
print(path)
""",
    ),
    Page(
        "jobs.md",
        "Jobs",
        ("s2c2a.jobs",),
        "many runs in parallel, on one machine or a cluster, with a cache",
        """
A `Job` is one run of a strategy on a task with one seed. Recordings and networks are
made once and kept in a `Cache`. `run_all` takes any `concurrent.futures` executor;
[Training on a cluster](../../guides/cluster.md) uses many machines.
""",
        """
from s2c2a.arm import load_arm
from s2c2a.jobs import jobs_for
from s2c2a.strategies import recipe_named

arm = load_arm("twin_arm")
recipe = recipe_named("best")
jobs = jobs_for(["circle", "tilt-50"], arm, ["s2c2a", "pcc"], range(3), recipe)
print(len(jobs), jobs[0])  # run_all(jobs, Cache()) runs them
""",
    ),
    Page(
        "logs.md",
        "Logs",
        ("s2c2a.logs",),
        "import of log files of a real arm as a recording",
        """
`import_logs` converts CSV, NPZ and MAT files to a recording, and identifies the arm that
made them. A `LogMap`, a TOML file, describes columns, units and frame. [Recordings of
your arm](../../guides/import.md) explains the map.
""",
        """
from s2c2a.logs import map_from_toml
from s2c2a.logs.errors import LogError

try:
    map_from_toml("drives = 3")
except LogError as error:
    print(error)  # names every key that is missing or wrong
""",
    ),
)
