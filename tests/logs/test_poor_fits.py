"""A poor fit that no change of the map explains is a warning, with what to check."""

import numpy as np
import pytest
from cable_parameters import straight_arm, wiring_of

from s2c2a.logs import LogMap, import_logs
from s2c2a.logs.cable_model import states_in_log
from s2c2a.logs.map_diagnosis import POOR
from s2c2a.logs.model_fit import predict_states
from s2c2a.logs.poor_fits import describe_poor_fit

ROWS = 80
TRUE = straight_arm([0.2])
CHECK = "check offset, unit, and positive of the drives"


def log_map(commands: str, key: str = "commanded") -> LogMap:
    drives = [{key: f"c{each}", "unit": "mm"} for each in range(3)]
    return LogMap.model_validate(
        {
            "rows": {"kind": "timed", "rate": 10, "commands": commands},
            "arm": {"name": "one", "modules": 1, "control_rate": 10},
            "drives": drives,
            "ends": [{"position": ["x", "y", "z"], "unit": "m"}],
        }
    )


@pytest.mark.parametrize("stated", ["sent", "settled"])
def test_the_other_choice_of_commands_is_named_where_it_fits(tmp_path, stated):
    """A log whose rows are measured before their command is sent."""
    commands = np.random.default_rng(0).uniform(-0.7, 0.7, (ROWS, 3))
    before = np.concatenate([commands[:1], commands[:-1]])
    _, states = predict_states(TRUE, wiring_of(1), before, False)
    ends = np.asarray(states_in_log(TRUE, states, np.eye(3)))[:, 0, :3]
    path = tmp_path / "log.csv"
    table = np.hstack([commands, ends])
    np.savetxt(path, table, "%.6f", ",", header="c0,c1,c2,x,y,z", comments="")
    imported = import_logs([path], log_map(stated))
    is_named = 'write rows.commands = "sent"' in imported.diagnosis
    assert is_named == (stated == "settled")


def test_a_good_fit_gives_no_warning():
    assert describe_poor_fit(0.9 * POOR, log_map("sent")) == ""


def test_a_poor_fit_gives_what_to_check():
    text = describe_poor_fit(1.1 * POOR, log_map("sent"))
    assert "does not fit clearly better" in text
    assert CHECK in text


def test_commands_are_not_blamed_where_drives_are_measured():
    text = describe_poor_fit(1.1 * POOR, log_map("sent", "measured"))
    assert CHECK in text
    assert "rows.commands" not in text
