"""No process that the package starts imports what lies in the current folder."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import s2c2a
from s2c2a.execution.child import child_command

EVIL = "import pathlib\npathlib.Path(__file__ + '.ran').touch()\n"
NAMES = ("signal", "random", "json", "selectors", "struct", "tempfile", "threading")
POOL = """
from s2c2a.execution.executors import Processes
if __name__ == "__main__":
    with Processes(1) as one:
        assert one.submit(abs, -1).result() == 1
"""
CONTROL = """
from s2c2a.arm import load_arm
from s2c2a.live.process import ControlProcess
from light_control import light_control
if __name__ == "__main__":
    control = ControlProcess(load_arm("twin_arm"), light_control)
    control.wait_until_ready()
    control.stop()
"""
CLUSTER = """
from s2c2a.jobs.cluster import Cluster
if __name__ == "__main__":
    with Cluster("local", 1) as one:
        assert one.submit(abs, -1).result() == 1
"""


PROGRAMS = {
    "pool": POOL,
    "control": CONTROL,
    "cluster": CLUSTER,
    "MuJoCo, emulated": "import s2c2a.lab.emulation.plant",
    "MuJoCo, batch": "import s2c2a.integrations.environments.lockstep",
    "MuJoCo, simulated": "import s2c2a\ns2c2a.SimulatedRobot",
}


@pytest.mark.parametrize("kind", PROGRAMS)
def test_files_named_as_those_of_python_are_not_run(kind, tmp_path):
    here, script = tmp_path / "here", tmp_path / "script.py"
    here.mkdir()
    for name in NAMES:
        (here / f"{name}.py").write_text(EVIL)
    light = Path(__file__).parents[1] / "live"
    script.write_text(f"import sys\nsys.path.append({str(light)!r})\n{PROGRAMS[kind]}")
    subprocess.run([sys.executable, script], cwd=here, check=True, timeout=120)
    assert not list(here.glob("*.ran"))


def test_there_is_one_way_to_start_a_process():
    for file in Path(s2c2a.__file__).parent.rglob("*.py"):
        text = file.read_text("utf-8")
        others = re.search(r"get_context|os\.(system|popen|exec|spawn|fork)", text)
        assert not others, file
        starts = text.count("subprocess.run(") + text.count("subprocess.Popen(")
        assert starts <= text.count("child_command(") + text.count('"git"'), file


def test_a_program_of_a_folder_does_not_see_its_neighbors(tmp_path):
    (tmp_path / "signal.py").write_text(EVIL)
    (tmp_path / "program.py").write_text("import signal\n")
    command = child_command(str(tmp_path / "program.py"))
    subprocess.run(command, cwd=tmp_path, check=True)
    assert not list(tmp_path.glob("*.ran"))
