import hashlib
import re
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.errors import StrategyError
from s2c2a.integrations.control_step import ControlStep
from s2c2a.integrations.exports.c_source import c_of, export_c, name_of, strategy_in
from s2c2a.models.session import DayChange
from s2c2a.strategies import (
    networks_from,
    save_networks,
    save_session,
    session_path,
    strategy_of,
)
from s2c2a.strategies.pcc import pcc_strategy
from s2c2a.strategies.session import Numbers, Session

from tools.c_step import (
    COMPILER,
    EQUAL,
    STRICT,
    CProgram,
    compare,
    recorded_inputs,
)

STEPS = 1000
FIXTURES = Path(__file__).parents[1] / "fixtures"
CALLER = """
#include "my_arm.h"
static my_arm_memory memory;
static my_arm_input input;
int main() { my_arm_clear(&input); return !my_arm_start(&memory, &input); }
"""
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


@needs_compiler
def test_a_step_in_c_is_that_of_jax(tmp_path):
    strategy = pcc_strategy(load_arm("twin_arm"))
    result = compare(strategy, tmp_path, STEPS, flags=("-O1",))
    assert len(result.differences) == STEPS
    assert result.differences.max() < EQUAL


@needs_compiler
def test_the_line_of_the_page_compiles_it(tmp_path):
    generated = c_of(pcc_strategy(load_arm("twin_arm")), "mine", "a test")
    (tmp_path / "mine.h").write_text(generated.header)
    (tmp_path / "mine.c").write_text(generated.source)
    page = Path(__file__).parents[2] / "docs" / "guides" / "export.md"
    (line,) = re.findall(r"^gcc -std.* -c mine.c .*$", page.read_text(), re.MULTILINE)
    command = line.replace("gcc", str(COMPILER), 1)
    subprocess.run(command, shell=True, check=True, cwd=tmp_path)
    assert (tmp_path / "mine.o").exists()


@pytest.mark.slow
@needs_compiler
def test_a_step_of_the_shipped_networks_in_c_is_that_of_jax(tmp_path):
    result = compare(strategy_in(Path("shipped")), tmp_path, STEPS)
    assert np.median(result.differences) < 1e-6
    # where a decision hangs on the last bits, both may decide otherwise
    assert len(result.rounding) <= 3
    for number, change in result.rounding.items():
        assert result.differences[number] <= 1.1 * change
    assert np.median(result.seconds_c) < 1.5 * np.median(result.seconds_jax)


@pytest.mark.slow
def test_a_control_step_is_that_of_the_loop():
    strategy = pcc_strategy(load_arm("twin_arm"))
    control = ControlStep(strategy)
    inputs, sent = recorded_inputs(strategy, control, 90)
    memory = control.start(inputs[0].measured)
    step = jax.jit(control.step)
    commands = []
    for each in inputs:
        command, memory = step(memory, each)
        commands.append(command)
    np.testing.assert_allclose(commands, sent, atol=1e-4 * np.ptp(sent))


def test_a_control_step_keeps_the_form_of_its_memory_with_a_camera():
    sensors = Sensors(camera=Camera())
    arm = load_arm("twin_arm").model_copy(update={"sensors": sensors})
    control = ControlStep(strategy_of(networks_from("shipped", arm)))
    example = control.example()
    before = jax.eval_shape(control.start, example.measured)
    _, after = jax.eval_shape(control.step, before, example)
    assert jax.tree.structure(after) == jax.tree.structure(before)


@needs_compiler
def test_what_is_not_finite_holds_the_last_command_and_says_so(tmp_path):
    strategy = pcc_strategy(load_arm("twin_arm"))
    control = ControlStep(strategy)
    example = control.example()
    program = CProgram(c_of(strategy, "held", "a test"), "held", tmp_path, example)
    shape = example.measured["cables"].shape
    goal = example.goal.with_position([0.2, 0.0, 0.5])
    moving = example._replace(goal=goal)
    for value in (np.nan, np.inf, -np.inf):
        lost = moving._replace(measured={"cables": np.full(shape, value)})
        bad = [lost] + [
            moving._replace(goal=goal._replace(**{name: np.full_like(array, value)}))
            for name, array in goal._asdict().items()
            if np.isinf(value) or name != "preview"
        ]
        assert not program.start(lost)
        program.step(moving, shape)
        assert not program.is_sound
        assert program.start(moving)
        command = program.step(moving, shape)
        assert program.is_sound
        for each in bad:
            np.testing.assert_array_equal(program.step(each, shape), command)
            assert not program.is_sound
        assert (program.step(moving, shape) != command).any()
        assert program.is_sound


@needs_compiler
@pytest.mark.slow
def test_the_command_writes_c_that_compiles(tmp_path):
    arm = load_arm("twin_arm")
    weights = tmp_path / "my arm.safetensors"
    save_networks(networks_from("shipped", arm), weights)
    command = [sys.executable, "-m", "s2c2a", "export", str(weights), "--to", "c"]
    done = subprocess.run(
        command, cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert "of memory" in done.stdout
    (tmp_path / "use.cpp").write_text(CALLER)
    for line in (
        [str(COMPILER), *STRICT, "-c", "my arm.c", "-o", "arm.o"],
        ["c++", *STRICT[1:], "use.cpp", "arm.o", "-o", "use"],
        ["./use"],
    ):
        subprocess.run(line, cwd=tmp_path, check=True)


@pytest.mark.slow
def test_c_holds_the_model_of_the_present_day(tmp_path):
    weights = tmp_path / "arm.safetensors"
    weights.write_bytes((FIXTURES / "best.safetensors").read_bytes())
    export_c(weights, tmp_path / "arm.c")
    trained = (tmp_path / "arm.c").read_text()
    count = load_arm("twin_arm").module_count
    change = replace(DayChange.none(count), softness=jnp.full(count, 0.2))
    session = Session(
        weights=hashlib.sha256(weights.read_bytes()).hexdigest(),
        arm="twin_arm",
        date=datetime.now(UTC),
        change=Numbers.of(change),
        before=0.01,
        after=0.005,
        improves=True,
    )
    save_session(session, session_path(weights))
    export_c(weights, tmp_path / "arm.c")
    assert (tmp_path / "arm.c").read_text() != trained


def test_names_of_files_become_names_of_c(tmp_path):
    assert name_of(tmp_path / "my arm-2.c") == "my_arm_2"
    assert name_of(tmp_path / "2arms.c") == "arm_2arms"


@pytest.mark.parametrize(
    ("name", "message"),
    [("only.h", r"choose a name that ends in \.c"), ("none.c", "no")],
)
def test_a_header_is_no_source_and_only_weights_are_exported(tmp_path, name, message):
    with pytest.raises(StrategyError, match=message):
        export_c(tmp_path / "none.safetensors", tmp_path / name)
    assert not list(tmp_path.iterdir())
