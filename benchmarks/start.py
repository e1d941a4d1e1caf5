"""What a start costs: processor time, programs, and lines of the largest program.

    python benchmarks/start.py [OTHER_CLONE ...]

follows the circle with the shipped networks of `twin_arm` in new processes, with an
empty cache and then with a full one, for this clone and for others beside it.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
CODE = """
import json, time
import s2c2a
from jax import monitoring
programs = []
def count(event, seconds, **_):
    if event.endswith("backend_compile_duration"):
        programs.append(seconds)
monitoring.register_event_duration_secs_listener(count)
arm = s2c2a.load_arm("twin_arm")
strategy = s2c2a.load_strategy("shipped", arm)
task = s2c2a.tasks.circle(arm)
run = s2c2a.run(s2c2a.SimulatedRobot(arm), strategy, task)
error = s2c2a.score_run(run, task)[0].value
spent = time.process_time()
step = strategy.step
reading = s2c2a.SimulatedRobot(arm).open()
strategy.start(reading)
times = []
for goal in task.goals:
    began = time.process_time()
    step(reading, goal)
    strategy.diagnostics()
    times.append(time.process_time() - began)
print(json.dumps([spent, len(programs), sorted(times)[len(times) // 2], float(error)]))
"""
HEAD = ("", "cache", "processor [s]", "programs", "lines", "step [ms]", "circle [cm]")


def started(clone: Path, cache: Path, texts: Path) -> list:
    """Row of a process that starts with this cache."""
    paths = [str(clone / "src"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(paths),
        "S2C2A_CACHE": str(cache),
        "JAX_DUMP_IR_TO": str(texts),
    }
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        env=environment,
        cwd=clone,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    spent, programs, step, error = json.loads(done.stdout.splitlines()[-1])
    sizes = [lines_of(text) for text in texts.rglob("*.mlir")]
    return [
        f"{spent:.1f}",
        programs,
        max(sizes, default=0),
        f"{1000 * step:.2f}",
        f"{error:.3f}",
    ]


def lines_of(text: Path) -> int:
    """Lines of a program, without those that say where its operations come from."""
    return sum(not line.startswith("#loc") for line in text.read_text().splitlines())


def main() -> None:
    """Print the table."""
    print(*HEAD, sep=" | ")
    for clone in (ROOT, *map(Path, sys.argv[1:])):
        with tempfile.TemporaryDirectory() as folder:
            for state in ("empty", "full"):
                texts = Path(folder, state)
                row = started(clone.resolve(), Path(folder, "cache"), texts)
                print(clone.name, state, *row, sep=" | ", flush=True)


if __name__ == "__main__":
    main()
