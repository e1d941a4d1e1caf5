"""Controllers (C2A): from the desired configuration to the next action."""

from s2c2a.control.controllers import (
    Controller,
    CorrectedController,
    InversePCC,
    NetworkController,
)
from s2c2a.control.options import C2AOptions, ControllerOptions
