"""`s2c2a robot`: check a body."""

from tyro.extras import SubcommandApp

from s2c2a.cli.bodies import RobotName, RobotOptions, body_for
from s2c2a.cli.console import Arm

app = SubcommandApp()


@app.command
def check(robot: RobotName = "sim", arm: Arm = "twin_arm", robot_option: RobotOptions = ()) -> None:
    """Open a body, drive it gently, and see that it keeps the promises that everything here relies on.

    It moves every cable by at most 5 % of its range. Keep clear of the arm all the same.

    Args:
        robot: the simulated arm, or a class of your own such as my_arm.py:MyArm.
        arm: a preset or an arm file: what the body is.
        robot_option: what the class takes.
    """
    from s2c2a.arm import load_arm
    from s2c2a.robots import check_robot

    body = body_for(robot, robot_option)
    for kept in check_robot(body.make(load_arm(arm), seed=0)):
        print(f"ok: it {kept}")
    print(f"{body} keeps its promises")
