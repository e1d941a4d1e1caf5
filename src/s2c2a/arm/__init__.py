"""Arm descriptions: parameters of an arm that a user can measure."""

from s2c2a.arm.files import arm_from_toml, arm_to_toml, load_arm, preset_names, save_arm
from s2c2a.arm.geometry import ArmGeometry
from s2c2a.arm.keys import Key, file_keys, keys_as_markdown
from s2c2a.arm.mismatch import Mismatch
from s2c2a.arm.randomized import randomized_arm
from s2c2a.arm.servos import ServoLimits, Servos, servos_of
from s2c2a.arm.spec import ArmSpec, Cable, Module, Motor
from s2c2a.arm.tracking import Tracking
