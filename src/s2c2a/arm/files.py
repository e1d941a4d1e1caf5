"""Arm files: reading and writing TOML, with error messages that name the key."""

import os
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import tomli_w

from s2c2a.arm.spec import ArmSpec
from s2c2a.errors import ArmError, did_you_mean
from s2c2a.files.text import check_replaceable, read_text, write_atomically
from s2c2a.plugins.discovery import trust_code

PRESETS = Path(__file__).parent / "presets"
"""Arm files of the package."""
ENDING = ".toml"


@cache
def preset_names() -> tuple[str, ...]:
    """Return the names of the presets, sorted."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.toml")))


def load_arm(name_or_path: str | os.PathLike) -> ArmSpec:
    """Load an arm by preset name or from a TOML file.

    The code that the file names is trusted (`plugins.trust_code`), since the user gave
    the file; it is imported when it is used. Files that it names are beside it, or in
    the current folder.

    Raises:
        ArmError: there is no such preset or file, or it has invalid TOML, an unknown
            key or an invalid value.
    """
    is_preset = str(name_or_path) in preset_names()
    path = PRESETS / f"{name_or_path}.toml" if is_preset else Path(name_or_path)
    if not path.is_file():
        raise ArmError(
            f"no arm '{name_or_path}'"
            f"{did_you_mean(str(name_or_path), preset_names())}: "
            "it is neither a preset "
            f"({', '.join(preset_names())}) nor a file; check the path, "
            "or copy a preset with `s2c2a arm copy PRESET FILE`"
        )
    arm = arm_from_toml(read_text(path, ArmError), source=str(name_or_path))
    bends = [module.bend_limit_deg for module in arm.modules if module.cable_angles_deg]
    if min(bends) <= np.pi:  # no bend in radians is larger
        warnings.warn(
            f"{name_or_path}: bend_limit_deg is {min(bends):g}; limits are in degrees: write "
            f"{np.rad2deg(min(bends)):.3g} if it is in radians, else leave it",
            stacklevel=2,
        )
    # other texts may stem from strangers: `s2c2a import` copies the description of a map
    names = [arm.sensing, *(raw.model for raw in arm.sensors.raw)]
    if arm.tracking is not None:
        names.append(arm.tracking.source)
    code = [name for name in names if ":" in name]
    trust_code(*code, folder=path.resolve().parent)
    return arm


def arm_from_toml(text: str, source: str = "arm") -> ArmSpec:
    """Parse and validate the text of an arm file; `source` names it in errors.

    The text may come from a recording: the code that it names is not trusted.

    Raises:
        ArmError: it has invalid TOML, an unknown key or an invalid value.
    """
    return ArmSpec.from_toml(text, source)


def arm_to_toml(arm: ArmSpec) -> str:
    """Write an arm as TOML; reading it back gives an equal arm."""
    return tomli_w.dumps(arm.model_dump(mode="json", exclude_none=True))


def save_arm(arm: ArmSpec, path: str | os.PathLike, overwrite: bool = False) -> None:
    """Write an arm file.

    Raises:
        ArmError: the file exists and `overwrite` is false, or it cannot be written.
    """
    check_replaceable(path, ENDING, ArmError, overwrite)
    write_atomically(arm_to_toml(arm), path, ArmError)
