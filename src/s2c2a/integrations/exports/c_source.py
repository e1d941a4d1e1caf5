"""Export form `c`: the control step of a trained strategy as C99."""

import re
from pathlib import Path

import s2c2a
from s2c2a.arm import load_arm
from s2c2a.errors import StrategyError
from s2c2a.files.text import write_atomically
from s2c2a.integrations.c_code.interface import Generated, generate
from s2c2a.integrations.control_step import ControlStep
from s2c2a.runtime.driver import StatedDriver
from s2c2a.strategies import RunOptions, networks_from, strategy_of
from s2c2a.strategies.checkpoint import SHIPPED
from s2c2a.strategies.strategy import Strategy


def export_c(file: Path, out: Path) -> str:
    """Write the control step of a weight file as a C source file and its header.

    Args:
        file: weights, such as mine.safetensors.
        out: the source file, such as mine.c; the header mine.h beside it is replaced,
            too. Other names become names of C: my-arm.c includes my_arm.h.

    Returns:
        What was written, with its memory.

    Raises:
        S2C2AError: no weight file, or a part of the strategy cannot be exported.
    """
    if out.suffix == ".h":
        raise StrategyError(
            f"--out '{out}' is the name of the header, which is written beside the "
            "source; choose a name that ends in .c"
        )
    name = name_of(out)
    generated = c_of(strategy_in(file), name, file.name)
    write_atomically(generated.source, out)
    write_atomically(generated.header, out.with_name(f"{name}.h"))
    return (
        f"control step ({generated.constant_bytes / 1000:.0f} kB of constants, "
        f"{generated.memory_bytes / 1000:.0f} kB of memory)"
    )


def c_of(strategy: Strategy, name: str, origin: str) -> Generated:
    """The C text of a strategy's control step.

    Args:
        strategy: to export.
        name: prefix of all names in C.
        origin: where it comes from, for the comment at the head.
    """
    step = ControlStep(strategy)
    arm = strategy.arm
    about = (
        f"Control step of {origin} for the arm {arm.name}, every "
        f"{arm.control_period:g} s; S2C2A {s2c2a.__version__}. Not in it: ways around "
        "obstacles, checks of sensors, emergency stop."
    )
    about = about.replace("*/", "* /")
    return generate(
        name, about, step.start, step.step, step.example(), lambda each: each.measured
    )


def strategy_in(file: Path) -> Strategy:
    """The strategy of a weight file, for its arm; of `twin_arm` for "shipped".

    Raises:
        StrategyError: no weight file, or a strategy without a control step.
    """
    # as in runs, without an arm
    arm = load_arm("twin_arm") if str(file) == SHIPPED else None
    strategy = strategy_of(networks_from(file, arm), RunOptions())
    if isinstance(strategy, StatedDriver):
        strategy = strategy.driver
    if not isinstance(strategy, Strategy):
        raise StrategyError(
            f"{file} holds a strategy of its own kind ({type(strategy).__name__}), which "
            "has no control step to export"
        )
    return strategy


def name_of(out: Path) -> str:
    """The name of a file as a name in C."""
    name = re.sub(r"\W", "_", out.stem)
    return name if name[:1].isalpha() else f"arm_{name}"
