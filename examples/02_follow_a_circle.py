"""Collect data, train the networks and follow a circle, in one or two minutes."""

import sys

import s2c2a

episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 18
arm = s2c2a.load_arm("twin_arm")  # or the path of an arm file

recording = s2c2a.collect(arm, "twin.episodes", episodes=episodes, overwrite=True)
strategy = s2c2a.train(recording, "twin.safetensors", overwrite=True)

task = s2c2a.tasks.circle(arm)
run = s2c2a.run(s2c2a.SimulatedRobot(arm), strategy, task)
for result in s2c2a.score_run(run, task):
    print(f"{result.value:.1f} {result.unit} from the circle on average")
