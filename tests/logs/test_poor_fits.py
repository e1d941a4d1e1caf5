"""A poor fit that no change of the map explains is a warning, with what to check."""

from types import SimpleNamespace

import numpy as np
import pytest
from cable_parameters import straight_arm, wiring_of

from s2c2a.logs import LogMap
from s2c2a.logs.cable_model import states_in_log
from s2c2a.logs.map_diagnosis import Given, missed_shares
from s2c2a.logs.model_fit import Observations, fit_parameters, predict_states
from s2c2a.logs.poor_fits import describe_poor_fit

from marks import slow_after

ROWS = 80
TRUE = straight_arm([0.2])
WIRING = wiring_of(1)
STD = {"gains": 0.1, "offsets": 0.1, "gravity": 1e-6, "base": 0.002, "tilt": 0.01}


def log_map(commands: str) -> LogMap:
    drives = [{"commanded": f"c{each}", "unit": "mm"} for each in range(3)]
    return LogMap.model_validate(
        {
            "rows": {"kind": "timed", "rate": 10, "commands": commands},
            "arm": {"name": "one", "modules": 1, "control_rate": 10},
            "drives": drives,
            "ends": [{"position": ["x", "y", "z"], "unit": "m"}],
        }
    )


def warn(stated: str, random_ends: bool = False, measured: bool = False) -> str:
    """Warning of a log whose rows are measured before their command is sent."""
    random = np.random.default_rng(0)
    commands = random.uniform(-0.7, 0.7, (ROWS, 3))
    before = np.concatenate([commands[:1], commands[:-1]])
    _, states = predict_states(TRUE, WIRING, before, False)
    states = np.asarray(states_in_log(TRUE, states, np.eye(3)))
    if random_ends:
        states = random.permutation(states)
    columns = before if stated == "sent" else commands
    observations = Observations(columns, states, np.eye(3), False, STD, 0.2)
    fit = fit_parameters(observations, TRUE, WIRING)
    motion = states[..., :3] - states[..., :3].mean(axis=0)
    rms = np.sqrt(np.mean(np.sum(motion**2, axis=-1)))
    residual = rms * missed_shares(fit, observations, np.zeros(ROWS))[0]
    values = columns if measured else np.full_like(commands, np.nan)
    take = SimpleNamespace(commands=commands, measured=values)
    given = Given(fit, None, observations, residual)  # type: ignore[arg-type]
    return describe_poor_fit([take], log_map(stated), given, TRUE)  # type: ignore[list-item]


@pytest.mark.slow
def test_the_other_choice_of_commands_is_named_where_it_fits():
    text = warn("settled")
    assert 'rows.commands = "sent"' in text
    assert "it misses 0 %" in text


def test_a_good_fit_gives_no_warning():
    assert warn("sent") == ""


@pytest.mark.parametrize("stated", slow_after(1, ["sent", "settled"]))
def test_ends_that_do_not_follow_the_drives_give_what_to_check(stated):
    text = warn(stated, random_ends=True)
    assert "does not fit clearly better" in text
    assert "no single change of the map explains it" in text
    assert "check offset, unit, and positive of the drives" in text


def test_commands_are_not_blamed_where_drives_are_measured():
    text = warn("sent", random_ends=True, measured=True)
    assert "check offset" in text
    assert "rows.commands" not in text
