"""Which body a verb drives: the simulated arm, or a class that the user names."""

from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.robots import Body

RobotName = Annotated[
    str,
    tyro.conf.arg(metavar="sim|MODULE:CLASS", help="the simulated arm, or a class of your own such as my_arm.py:MyArm"),
]
RobotOptions = Annotated[
    tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...", help="what the class of --robot takes beside the arm")
]
SIMULATED = "sim"


def body_for(robot: str, options: tuple[str, ...], fidelity: str = "fast", payload: float = 0.0) -> "Body":
    """The body, and how it is made; nothing is opened yet.

    Raises:
        S2C2AError: no such class, no option, or one of the simulation's for another body.
    """
    from s2c2a.robots import Body, options_from
    from s2c2a.robots.making import robot_class

    given = options_from(options)
    if robot == SIMULATED:
        body = Body.simulation(fidelity, payload)
        return Body(SIMULATED, (*body.options, *given))
    if fidelity != "fast" or payload:
        raise S2C2AError(f"--fidelity and --payload are of the simulated arm, and --robot is {robot}; leave them out")
    robot_class(robot)  # what is not there is told before anything else
    return Body(robot, given)
