from .files import arm_from_toml, arm_to_toml, load_arm, preset_names, save_arm
from .geometry import ArmGeometry
from .keys import Key, file_keys
from .mismatch import Mismatch
from .randomized import randomized_arm
from .servos import ServoLimits, Servos, servos_of
from .spec import ArmSpec, Cable, Module, Motor
from .tracking import Tracking

__all__ = [
    "ArmGeometry",
    "ArmSpec",
    "Cable",
    "Key",
    "Mismatch",
    "Module",
    "Motor",
    "ServoLimits",
    "Servos",
    "Tracking",
    "arm_from_toml",
    "arm_to_toml",
    "file_keys",
    "load_arm",
    "preset_names",
    "randomized_arm",
    "save_arm",
    "servos_of",
]
