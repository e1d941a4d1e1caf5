"""Collect data, train the networks and follow a circle, in one or two minutes."""

import sys
from dataclasses import replace

from s2c2a.arm import load_arm
from s2c2a.data import collect
from s2c2a.evaluation import position_errors, rollout
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import recipe_named, s2c2a_strategy, train_s2c2a
from s2c2a.tasks import circle

episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 18
arm = load_arm("twin_arm")  # or the path of an arm file
recipe = recipe_named("best")

options = replace(recipe.collect_options(), episodes=episodes)
recording = collect(
    "twin.episodes",
    arm,
    lambda seed: SimulatedRobot(arm, seed=seed),
    options,
    overwrite=True,
)
networks = train_s2c2a(recording, recipe, seed=0)
strategy = s2c2a_strategy(networks)

task = circle(arm)
run = rollout(SimulatedRobot(arm), strategy, task)
errors = position_errors(run.after("states"), task.desired_positions())
print(f"{errors.mean():.1f} cm from the circle on average")
