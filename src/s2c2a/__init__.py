"""Plan and control modular soft robot arms: State to Configuration to Action.

Record a simulated arm, train a strategy, and follow a circle:

    import s2c2a

    arm = s2c2a.load_arm("twin_arm")
    recording = s2c2a.collect(arm, "twin.episodes")
    strategy = s2c2a.train(recording, "twin.safetensors", overwrite=True)
    task = s2c2a.tasks.circle(arm)
    run = s2c2a.run(s2c2a.SimulatedRobot(arm), strategy, task)
    s2c2a.save_episodes([run], "circle.episodes")
    for result in s2c2a.score_run(run, task):
        print(result.score.metric, round(result.value, 2), result.unit)

The arm:
    load_arm         a preset or an arm file
    save_arm         write an arm file
    ArmSpec          description of an arm: modules, cables, motors, sensors
Data:
    collect          record random motion of an arm
    load_recording   read what `collect` wrote
    Recording        episodes of one arm: time, actions, and values of each sensor
Strategies:
    train            train a strategy on a recording, and save its networks
    load_strategy    build a strategy from a weight file, or from the shipped networks
    pcc_strategy     constant-curvature arcs, which need no training
    Strategy         state estimator, planner and controller of an arm
    Recipe           every choice about data, training, estimation and planning
    recipe_from      a recipe by name ("best", "paper"), or from a file
Runs:
    SimulatedRobot   the simulated arm
    Robot            the interface of every arm; derive your own from it
    RobotFactory     a class of robots and its options, for `collect`
    run              run a strategy on a task
    score_run        errors of a run
    tasks            tasks of the package, waypoints, and parts of your own tasks
    Task             one goal for every control step, and the scores of a run
Step by step:
    Loop             the control loop; `tick` does one control step
    StepRequest      what a step is asked for: a goal, or to hold the arm
    Goal             desired positions and axes of module ends, and obstacles
    build_episode    an episode from the records of steps
Files of runs:
    save_episodes    write episodes to a file, which `s2c2a view` shows
    load_episodes    read it
    Episode          columns of a run, one row for every control step

`s2c2a.paper` is the method of the paper in one file. docs/get-started/python.md leads
through these names. Other names are in the packages, such as `s2c2a.planning`.
"""

import lazy_loader

from s2c2a.execution.after_import import import_after
from s2c2a.execution.jax_settings import configure_jax

__version__ = "1.1.0.dev0"

configure_jax()  # before a module of the package imports JAX
import_after("gymnasium", "s2c2a.integrations.environments.registration")
import_after("IPython", "s2c2a.viz.notebook")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
