"""Arm files: reading and writing TOML, with error messages that name the key."""

import os
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import tomli_w
from pydantic import ValidationError

from s2c2a.arm.spec import ArmSpec
from s2c2a.errors import ArmError, S2C2AError, did_you_mean
from s2c2a.files.text import check_replaceable, parse_toml, read_text, write_atomically
from s2c2a.files.validation import explained, key_names
from s2c2a.plugins.discovery import trust_code

PRESETS = Path(__file__).parent / "presets"
"""Arm files of the package."""
ENDING = ".toml"
HEADING = "{faults} in the arm description (modules count from 0, at the base)"


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
    limits = {
        "bend_limit_deg": (min(bends), 1.0),
        # steps that are slower than a second are poses
        "step_limit_deg": (arm.step_limit_deg, max(arm.control_rate, 1.0)),
    }
    for key, (limit, rate) in limits.items():
        # no bend in radians is larger, and no speed of bends in radians a second
        if limit * rate <= np.pi:
            text = f"{name_or_path}: {key} is {limit:g}; did you mean degrees?"
            warnings.warn(text, stacklevel=2)
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
    try:
        return ArmSpec.model_validate(parse_toml(text))
    except S2C2AError as error:
        raise ArmError(
            f"{source}: {error}; correct that place or start again from a preset"
        ) from error
    except ValidationError as error:
        heading = f"{source}: {HEADING}"
        raise ArmError(explained(error, heading, key_names(ArmSpec), _hint)) from error


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


def _hint(fault) -> str:
    """Suggest wrong units where a number is outside its range."""
    out_of_range = fault["type"] in ("greater_than_equal", "less_than_equal")
    if not out_of_range or not fault["input"]:
        return ""
    if str(fault["loc"][-1]).endswith("_deg"):
        return "; this key is in degrees"
    return "; values are in SI units (m, kg, N, s, Hz): is it off by a factor of 1000?"
