"""The study of sessions: changes of known size, and drawn ones with their truth."""

import numpy as np
import pytest

from s2c2a.jobs import make_all
from s2c2a.strategies import shipped_networks
from s2c2a_experiments import session as study


@pytest.mark.slow
def test_every_change_has_its_rows_and_drawn_days_their_coverage(
    twin, cache, monkeypatch, tmp_path
):
    monkeypatch.setattr(study, "SECONDS", 20.0)
    monkeypatch.setattr(study, "TESTED", 1)
    monkeypatch.setattr(study, "CHANGES", ("all",))

    def make(needed):
        if isinstance(needed[0], study.jobs.NetworksArtifact):
            return [shipped_networks(twin)]
        return make_all(needed, cache)

    kept = []
    small = study.SessionStudy((twin,), starts=1, days=1, drawn=1)
    rows = study.session_rows(
        small, tmp_path, make, lambda rows: kept.append(len(rows))
    )
    assert kept[-1] == len(rows)
    found = {(row.strategy, row.metric): row.mean for row in rows}
    for change in study.CHANGES:
        assert found[f"{change}, with session", "improves"] in (0.0, 1.0)
        for session in ("without", "with"):
            assert found[f"{change}, {session} session", "position"] > 0.0
    errors = [
        found[f"all, {session} session", "model error"]
        for session in ("with", "without")
    ]
    assert errors[0] < errors[1]
    shares = [value for (name, _), value in found.items() if name == "drawn days"]
    assert len(shares) == 5
    assert np.mean(shares) > 0.5
