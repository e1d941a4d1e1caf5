"""Command `s2c2a ros` in a process of its own, driven from another one."""

import signal
import subprocess
import sys

import numpy as np
import pytest
from test_ros_loopback import RosSide, free_port  # type: ignore[import-not-found]

from s2c2a.arm import load_arm
from s2c2a.arm.files import save_arm

pytest.importorskip("zenoh_ros2_sdk")
COMMAND = "import sys; from s2c2a.cli.main import main; main(sys.argv[1:])"


@pytest.mark.slow
def test_the_command_drives_and_ends_at_rest(tmp_path):
    arm = tmp_path / "mine.toml"
    twin = load_arm("twin_arm")
    thin = [module.model_copy(update={"mass": 0.04}) for module in twin.modules]
    # an arm without shipped networks, whose compilation takes longer
    save_arm(twin.model_copy(update={"name": "mine", "modules": tuple(thin)}), arm)
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    words = ["ros", str(arm), "--router", "--endpoint", endpoint, "--timeout", "60"]
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *words],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert "is being prepared" in process.stdout.readline()
        assert "Ctrl-C ends it" in process.stdout.readline()
        side = RosSide(port)
        target = [0.1, 0.0, 0.6]
        side.order(target=target, frame="base")
        side.until(
            "tip_pose",
            lambda each: np.linalg.norm(np.subtract(each["tip"], target)) < 0.05,
        )
        side.end()
        process.send_signal(signal.SIGINT)
        assert process.stdout.read().endswith("has stopped; at rest.\n")
        assert process.wait(30) == 0
    finally:
        process.kill()
