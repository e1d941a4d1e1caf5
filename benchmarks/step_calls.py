"""Python calls and files of one warm control step, without the simulation.

python benchmarks/step_calls.py [ARM]
"""

import sys
from collections import Counter
from pathlib import Path

import s2c2a

WARM = 40
PACKAGE = Path(s2c2a.__file__).parent
SIMULATION = PACKAGE / "robots" / "simulation"


def main(name: str = "twin_arm") -> None:
    """Count the calls of functions of the package, by file."""
    arm = s2c2a.load_arm(name)
    goals = s2c2a.tasks.circle(arm).goals
    calls: Counter[str] = Counter()

    def count(frame, event, argument) -> None:
        path = Path(frame.f_code.co_filename)
        is_ours = path.is_relative_to(PACKAGE) and not path.is_relative_to(SIMULATION)
        if event == "call" and is_ours:
            calls[str(path.relative_to(PACKAGE))] += 1

    strategy = s2c2a.load_strategy(arm=arm)
    with s2c2a.Loop(s2c2a.SimulatedRobot(arm), strategy) as loop:
        for goal in goals[:WARM]:
            loop.tick(s2c2a.StepRequest(goal))
        request = s2c2a.StepRequest(goals[WARM])
        sys.setprofile(count)
        loop.tick(request)
        sys.setprofile(None)
    print(f"{calls.total()} calls in {len(calls)} files")
    for file, number in calls.most_common():
        print(f"{number:4d} {file}")


if __name__ == "__main__":
    main(*sys.argv[1:])
