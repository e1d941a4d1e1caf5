"""The simulator's chain against a Cosserat rod of SoRoSim, for some of its shapes."""

from pathlib import Path

import numpy as np
import pytest

from sorosim import (
    LENGTH,
    first_mode,
    read_release,
    read_shapes,
    rest,
    rod,
    static_error,
    vibration,
)

PIECE = Path(__file__).parent / "sorosim"


def test_the_tip_rests_within_a_third_of_a_percent_of_the_length_from_their_rod():
    errors = [
        static_error(shape) for shape in read_shapes(PIECE / "statics_tpu.csv.gz")
    ]
    assert len(errors) == 12
    assert max(errors) < LENGTH / 300


@pytest.mark.slow
def test_a_chain_of_half_as_many_segments_errs_at_least_twice_as_much():
    shapes = read_shapes(PIECE / "statics_tpu.csv.gz")
    coarse, fine = (
        np.mean([static_error(shape, segments) for shape in shapes])
        for segments in (10, 20)
    )
    assert coarse > 2 * fine


def test_the_chain_at_rest_stays_at_rest():
    shape = read_shapes(PIECE / "statics_tpu.csv.gz")[0]
    weight_only = type(shape)(
        shape.gravity, 0 * shape.moments, 0 * shape.forces, shape.places
    )
    assert np.abs(rest(rod(shape.gravity), weight_only).qacc).max() < 1e-4


def test_the_chain_swings_at_their_frequency_with_their_damping():
    release = read_release(PIECE / "dynamics_tpu_2.txt.gz")
    ours = vibration(release)
    frequency, damping = first_mode(release.places)
    assert first_mode(ours) == (
        pytest.approx(frequency, rel=0.002),
        pytest.approx(damping, rel=0.02),
    )
    assert (
        np.linalg.norm(ours[:, 1] - release.places[:, 1], axis=-1).max() < 0.01 * LENGTH
    )
