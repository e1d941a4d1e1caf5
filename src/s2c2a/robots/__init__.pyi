from .conformance import (
    check_robot as check_robot,
)
from .factory import (
    RobotFactory as RobotFactory,
)
from .robot import (
    Robot as Robot,
)
from .robot import (
    checked_action as checked_action,
)
