"""C2A: from the desired configuration to the next action. Knows nothing of states."""

from s2c2a.control.controllers import (
    Controller,
    CorrectedController,
    InversePCC,
    NetworkController,
)
