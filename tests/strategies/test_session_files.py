"""Session files: written, read, refused, and used."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.data import load_recording
from s2c2a.errors import StrategyError
from s2c2a.evaluation import describe_session
from s2c2a.jobs import GivenNetworks
from s2c2a.models.forward_model import along_episode
from s2c2a.models.session import DayChange, SessionC2S
from s2c2a.models.session_fit import fit_session
from s2c2a.strategies import (
    describe_use,
    load_networks,
    load_session,
    measured_session,
    networks_from,
    save_networks,
    save_session,
    session_of,
    session_path,
    training_data,
    with_session,
)
from s2c2a.strategies.session import Numbers, Session

FIXTURES = Path(__file__).parents[1] / "fixtures"


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "twin.safetensors"
    path.write_bytes((FIXTURES / "best.safetensors").read_bytes())
    return path


@pytest.fixture(scope="module")
def networks(weights):
    return load_networks(weights)


@pytest.fixture(scope="module")
def short():
    """The first episode of the fixture."""
    recording = load_recording(FIXTURES / "twin.episodes")
    options = {**recording.options, "episodes": 1}
    return replace(recording, episodes=recording.episodes[:1], options=options)


@pytest.fixture(scope="module")
def measured(networks, weights, short):
    return measured_session(networks, weights, short)[0]


@pytest.fixture
def improving(measured):
    """The same, of a session that halves the error."""
    errors = {"before": 0.02, "after": 0.01}
    return measured.model_copy(update=errors | {"improves": True})


@pytest.fixture(scope="module")
def data(networks, short):
    return training_data(short, networks.recipe)


@pytest.fixture(scope="module")
def none(networks):
    return DayChange.none(networks.arm.module_count)


@pytest.fixture
def states_after(networks, data):
    """States of the recording's arm after a change, with noise [m]."""

    def states(change, noise):
        model = SessionC2S.of(networks.c2s, change)
        sensed = jnp.asarray(data.sensed[0], jnp.float32)
        states = np.asarray(along_episode(lambda _: model, sensed, sensed))
        return states + np.random.default_rng(0).normal(scale=noise, size=states.shape)

    return states


def showing(short, states):
    """The recording whose tracker shows other states."""
    columns = short.episodes[0].columns | {"sensor.states": states}
    return replace(short, episodes=(replace(short.episodes[0], columns=columns),))


def test_a_session_is_read_as_it_was_written(measured, weights, tmp_path):
    path = tmp_path / "day.session.json"
    save_session(measured, path)
    assert load_session(path, weights) == measured


def test_a_session_beside_the_weights_is_used_unless_it_is_left_out(improving, weights):
    path = session_path(weights)
    save_session(improving, path)
    try:
        assert session_of(weights) == improving
        assert session_of(weights, "none") is None
        assert isinstance(networks_from(weights).c2s, SessionC2S)
        assert "from 20.0 mm to 10.0 mm" in describe_use(improving)
    finally:
        path.unlink()
    assert session_of(weights) is None
    assert not isinstance(networks_from(weights).c2s, SessionC2S)


def test_a_session_of_other_weights_is_refused(measured, tmp_path, weights):
    other = tmp_path / "other.safetensors"
    other.write_bytes(weights.read_bytes() + b" ")
    save_session(measured, session_path(other))
    with pytest.raises(StrategyError, match="measured with other weights"):
        session_of(other)


@pytest.mark.parametrize(
    "update",
    [
        {"code": "import os"},
        {"before": -1.0},
        {"before": float("nan")},
        {"before": 1e300},
        {"weights": "0"},
        {"change": {"translation": [5.0, 0.0, 0.0]}},
    ],
)
def test_a_damaged_session_is_refused(measured, weights, tmp_path, update):
    path = tmp_path / "damaged.session.json"
    path.write_text(json.dumps(measured.model_dump(mode="json") | update))
    with pytest.raises(StrategyError, match="session"):
        load_session(path, weights)


def test_a_session_of_an_older_version_says_how_to_make_it_anew(
    measured, weights, tmp_path
):
    path = tmp_path / "old.session.json"
    older = measured.model_dump(mode="json") | {"format": 1, "gains": [1.0]}
    path.write_text(json.dumps(older))
    with pytest.raises(StrategyError, match="of another version"):
        load_session(path, weights)


def test_a_session_of_another_number_of_modules_is_refused(measured, networks):
    change = measured.change.model_copy(update={"softness": (0.0,)})
    update = {"change": change, "improves": True}
    with pytest.raises(StrategyError, match="modules"):
        with_session(networks, measured.model_copy(update=update))


def test_a_session_that_does_not_improve_is_not_used(measured, networks):
    session = measured.model_copy(
        update={"before": 0.01, "after": 0.01, "improves": False}
    )
    assert with_session(networks, session) is networks
    assert "stays as it is" in describe_use(session)


def test_predictions_state_at_least_the_error_of_the_session(improving, networks):
    session = improving.model_copy(update={"after": 0.5})
    model = with_session(networks, session).c2s
    rest = jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0]), (networks.arm.module_count, 3))
    memory = model.start(rest)
    std = np.asarray(model.predictive_std(rest, memory))
    np.testing.assert_allclose(std, 0.5 * np.arange(1, len(std) + 1) / len(std))
    # cables that are longer now are no other motion than that of the training
    longer = session.change.model_copy(update={"slack": (0.5,) * len(std)})
    slack = with_session(networks, session.model_copy(update={"change": longer})).c2s
    np.testing.assert_allclose(slack.extrapolation(rest), model.extrapolation(rest))


def test_a_session_is_measured_against_the_networks_of_the_training_alone(
    improving, weights, networks, short
):
    corrected = with_session(networks, improving)
    with pytest.raises(StrategyError, match="have a session already"):
        measured_session(corrected, weights, short)
    with pytest.raises(StrategyError, match="have a session already"):
        with_session(corrected, improving)
    before = weights.read_bytes()
    with pytest.raises(StrategyError, match="a file of its own"):
        save_networks(corrected, weights)
    assert weights.read_bytes() == before


@pytest.mark.slow
def test_a_tracker_that_repeats_one_pose_is_no_change_of_the_arm(
    networks, weights, short
):
    states = short.episodes[0].sensor("states")
    frozen = showing(short, np.repeat(states[:1], len(states), axis=0))
    session, fit = measured_session(networks, weights, frozen)
    assert session.before > 0.2
    assert with_session(networks, session) is networks
    assert "check homing and tracking" in describe_session(fit, networks.arm)[-1]


@pytest.mark.slow
@pytest.mark.parametrize("part", ["slack", "softness"])
def test_cables_and_stiffness_change_what_a_model_of_them_predicts(
    networks, data, none, part
):
    loose = replace(none, **{part: jnp.full(data.arm.module_count, 0.2)})
    sensed = jnp.asarray(data.sensed[0, 20], jnp.float32)
    states = []
    for change in (none, loose):
        model = SessionC2S.of(networks.c2s, change)
        states.append(np.asarray(model.predict(sensed, model.start(sensed))))
    assert np.linalg.norm(states[1][-1, :3] - states[0][-1, :3]) > 1e-3


def test_cables_that_pull_together_are_no_change(networks, data):
    sensed = jnp.asarray(data.sensed, jnp.float32)
    own = np.asarray(networks.c2s.body.displacements(sensed))
    together = 0.1 * np.sin(np.arange(own.shape[1]) / 7.0)
    pulled = replace(data, displacements=own + together[:, None, None])
    states = networks.recipe.c2s.predictions(networks.c2s, pulled)
    noise = np.random.default_rng(0).normal(scale=5e-4, size=states.shape)
    fit = fit_session(networks.c2s, replace(pulled, states=states + noise))
    assert fit.before < 1e-3
    assert not fit.improves


def test_a_session_finds_modules_that_have_become_softer(
    networks, data, none, states_after
):
    softer = replace(none, softness=jnp.asarray([0.2, 0.15, 0.1]))
    states = states_after(softer, noise=5e-4)
    fit = fit_session(networks.c2s, replace(data, states=states[None]))
    assert fit.improves
    found, std = (
        np.asarray(each.softness) for each in (fit.posterior.change, fit.posterior.std)
    )
    np.testing.assert_allclose(found, softer.softness, atol=0.05)
    assert (np.abs(found - softer.softness) < 2.0 * std).all()
    # no better known than what softness does, and what can stand for it
    assert (std > 0.19 * np.abs(found)).all()
    assert (np.asarray(fit.posterior.std.slack) > 0.19 * np.abs(found)).all()
    # the share, not the logarithm
    share = 100.0 * np.expm1(found[0])
    assert f"{share:+.1f} ±" in " ".join(describe_session(fit, data.arm))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turn", "earlier_turn", "is_kept", "improves"),
    [
        (0.2, 0.2, True, True),  # the true change, against one that is fitted
        (0.2, -0.2, False, True),
        (0.0, -0.2, False, False),
    ],
)
def test_the_better_of_earlier_new_and_no_session_is_used(
    networks,
    weights,
    measured,
    short,
    none,
    states_after,
    turn,
    earlier_turn,
    is_kept,
    improves,
):
    def turned(angle):
        return replace(none, rotation=jnp.asarray([0.0, 0.0, angle]))

    day = showing(short, states_after(turned(turn), noise=2e-3))
    earlier = measured.model_copy(
        update={"change": Numbers.of(turned(earlier_turn)), "improves": True}
    )
    now = datetime(2026, 1, 6, tzinfo=UTC)
    session, fit = measured_session(networks, weights, day, now, earlier)
    assert (session.change == earlier.change) == is_kept
    assert session.improves == improves
    assert session.date == now
    report = " ".join(describe_session(fit, networks.arm))
    assert ("runs go on with" in report) == is_kept
    assert ("runs use no session" in report) == (not improves)


@pytest.mark.parametrize(
    "of",
    [
        {"date": datetime(2026, 1, 6, tzinfo=UTC)},  # its own recording
        {"improves": False},
        {"modules": 1},
    ],
)
def test_an_earlier_session_that_proves_nothing_does_not_compete(
    networks, weights, short, none, monkeypatch, of
):
    now = datetime(2026, 1, 6, tzinfo=UTC)
    change = Numbers.of(DayChange.none(of.pop("modules", networks.arm.module_count)))
    earlier = Session(
        weights=64 * "0",
        arm=networks.arm.name,
        **{"date": now - timedelta(1), "change": change, "improves": True} | of,
        before=0.01,
        after=0.005,
    )
    given = []

    def fitted(model, data, earlier):
        given.append(earlier)
        return SimpleNamespace(change=none, before=0.01, after=0.01, improves=False)

    monkeypatch.setattr("s2c2a.strategies.session.fit_session", fitted)
    measured_session(networks, weights, short, now, earlier)
    assert given == [None]


def test_a_plan_near_a_configuration_keeps_the_session(networks, data, none):
    sensed = jnp.asarray(data.sensed[0, 20], jnp.float32)
    moved = jnp.full(3, 0.01)
    change = replace(none, translation=moved, slack=jnp.full_like(none.slack, 0.02))
    model = SessionC2S.of(networks.c2s, change)
    memory = model.start(sensed)
    near = model.near(sensed, memory).for_planning()
    np.testing.assert_allclose(
        near.predict(sensed, memory), model.predict(sensed, memory), atol=1e-4
    )


@pytest.mark.slow
def test_runs_with_and_without_a_session_are_kept_apart(measured, weights, networks):
    plain = GivenNetworks.read(weights, networks.arm)
    other = GivenNetworks.read(weights, networks.arm, session=measured)
    assert plain.file != other.file
