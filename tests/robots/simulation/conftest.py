"""What the tests of the simulation share."""

import pytest

from s2c2a.robots.simulation import FIDELITIES


@pytest.fixture(params=FIDELITIES)
def fidelity(request):
    """Each fidelity by name."""
    return request.param
