"""Session files: how an arm has changed since its training, beside its weights.

Plain JSON. A session belongs to one weight file, by its digest.
"""

import hashlib
import os
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import jax.numpy as jnp
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError

from s2c2a.data import Recording
from s2c2a.errors import RecordingError, StrategyError, counted, listed
from s2c2a.files.json_files import load_json, save_json
from s2c2a.files.text import LARGEST
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.session import DayChange, SessionC2S
from s2c2a.models.session_fit import SessionFit, fit_session
from s2c2a.strategies.checkpoint import SHIPPED
from s2c2a.strategies.s2c2a import training_data
from s2c2a.strategies.trained import TrainedNetworks

ENDING = ".session.json"
NO_SESSION = "none"
MAKE_ONE = "make one with `s2c2a session`, delete it, or add `--session none`"
Length = Annotated[float, Field(ge=-100.0, le=100.0)]  # m; of a room with a tracking
Angle = Annotated[float, Field(ge=-4.0, le=4.0)]  # rad; fits turn a little beyond pi
Softness = Annotated[float, Field(ge=-1.0, le=1.0)]  # five times what arms change by
Error = Annotated[float, Field(ge=0.0, le=LARGEST)]


class Numbers(BaseModel):
    """The numbers of a change; see `DayChange`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    translation: tuple[Length, Length, Length]
    rotation: tuple[Angle, Angle, Angle]
    offsets: tuple[tuple[Angle, Angle], ...]
    slack: tuple[Angle, ...]
    softness: tuple[Softness, ...]

    @classmethod
    def of(cls, change: DayChange) -> "Numbers":
        """The numbers of a change."""
        return cls(**{name: part.tolist() for name, part in vars(change).items()})

    def change(self) -> DayChange:
        """The change of these numbers."""
        parts = self.model_dump()
        return DayChange(
            **{name: jnp.asarray(part, jnp.float32) for name, part in parts.items()}
        )


class Session(BaseModel):
    """The present day of an arm.

    Attributes:
        weights: digest of the weight file that it belongs to.
        arm: name of the arm.
        date: of the motion that judged it last.
        change: since the training.
        before: mean error of the tip without the change [m].
        after: the same with it, on stretches that it was not fitted to [m].
        improves: whether it surely lowers the squared error there.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    format: Literal[3] = 3
    weights: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    arm: Annotated[str, Field(max_length=64)]
    date: AwareDatetime
    change: Numbers
    before: Error
    after: Error
    improves: bool


def session_path(weights: str | os.PathLike) -> Path:
    """Where the session of a weight file is kept: beside it."""
    return Path(weights).with_suffix(ENDING)


def measured_session(
    networks: TrainedNetworks,
    weights: str | os.PathLike,
    recording: Recording,
    date: datetime | None = None,
    earlier: Session | None = None,
) -> tuple[Session, SessionFit]:
    """Measure the present day of an arm from a recording with the tip seen.

    Args:
        networks: of the weight file, without a session.
        weights: the file.
        recording: of the present day.
        date: of the recording; now by default.
        earlier: whose change is kept if it is of another recording, and predicts this
            one better.

    Raises:
        StrategyError: the networks hold no forward model or a session already, or the
            arm is another one.
        RecordingError: the tip or the configurations are not known, or no arm changes
            by as much.
    """
    arm = recording.arm
    if networks.arm.differences(arm):
        raise StrategyError(
            f"{weights} was trained for '{networks.arm.name}', and the recording is of "
            f"'{arm.name}', which differs in {listed(networks.arm.differences(arm))}"
        )
    date = date or datetime.now(UTC)
    was = None
    # its own recording would flatter an earlier session
    if earlier and earlier.improves and earlier.date != date:
        was = earlier.change.change() if _fits(earlier, arm.module_count) else None
    fit = fit_session(_model(networks), training_data(recording, networks.recipe), was)
    try:
        session = Session(
            weights=_digest(weights),
            arm=arm.name,
            date=date,
            change=Numbers.of(fit.change),
            before=fit.before,
            after=fit.after,
            improves=fit.improves,
        )
    except ValidationError as error:
        found = [f"{each['loc'][0]} {each['input']:.2g}" for each in error.errors()]
        raise RecordingError(
            "no arm changes between days by as much as this recording shows "
            f"({', '.join(found)}); check homing and tracking (`s2c2a tracking frames`), "
            "or train anew"
        ) from error
    return session, fit


def save_session(session: Session, path: str | os.PathLike) -> None:
    """Write a session file; an interruption leaves the former file.

    Raises:
        StrategyError: the file cannot be written.
    """
    save_json(session, path, StrategyError)


def load_session(path: str | os.PathLike, weights: str | os.PathLike) -> Session:
    """Read the session of a weight file.

    Raises:
        StrategyError: there is no such file, it is damaged, or it belongs to other
            weights.
    """
    session = load_json(Session, path, StrategyError, "session", MAKE_ONE)
    if session.weights != _digest(weights):
        raise StrategyError(
            f"{path} was measured with other weights than {weights}; {MAKE_ONE}"
        )
    return session


def session_of(weights: str | os.PathLike, chosen: str = "") -> Session | None:
    """The session to use with a weight file.

    Args:
        weights: the file.
        chosen: a session file; "none" for no session; empty for that beside the
            weights, if there is one.

    Raises:
        StrategyError: see `load_session`.
    """
    if chosen == NO_SESSION or (not chosen and str(weights) == SHIPPED):
        return None
    path = Path(chosen) if chosen else session_path(weights)
    if not chosen and not path.exists():
        return None
    return load_session(path, weights)


def with_session(networks: TrainedNetworks, session: Session | None) -> TrainedNetworks:
    """Networks on the day of a session; the same where it does not improve them.

    Raises:
        StrategyError: they hold no forward model, or the modules differ in number.
    """
    if session is None or not session.improves:
        return networks
    modules = networks.arm.module_count
    if not _fits(session, modules):
        raise StrategyError(
            f"the session has not the {counted(modules, 'module')} of "
            f"'{networks.arm.name}'; {MAKE_ONE}"
        )
    model = SessionC2S.of(_model(networks), session.change.change(), session.after)
    corrected = replace(networks.trained["C2S"], network=model)
    return replace(networks, trained={**networks.trained, "C2S": corrected})


def _fits(session: Session, modules: int) -> bool:
    change = session.change
    return {len(change.offsets), len(change.slack), len(change.softness)} == {modules}


def describe_use(session: Session) -> str:
    """Describe in a sentence that a session is used, or why it is not."""
    when = f"session of {session.date:%Y-%m-%d %H:%M} UTC"
    before = f"{1000 * session.before:.1f} mm"
    if not session.improves:
        return f"{when}: the model stays as it is, with {before} at the tip"
    after = f"{1000 * session.after:.1f} mm"
    return f"{when}: the model is corrected, from {before} to {after} at the tip"


def _model(networks: TrainedNetworks) -> ForwardModel:
    model = networks.networks.get("C2S")
    if not isinstance(model, ForwardModel):
        raise StrategyError(
            f"networks of {networks.strategy} hold no forward model that a session "
            "could correct; take those of s2c2a, or leave it out with --session none"
        )
    if isinstance(model, SessionC2S):
        raise StrategyError(
            "these networks have a session already, and a session is measured against "
            "and used with those of the training; take them from load_networks"
        )
    return model


def _digest(weights: str | os.PathLike) -> str:
    try:
        return hashlib.sha256(Path(weights).read_bytes()).hexdigest()
    except OSError as error:
        raise StrategyError(f"{weights} cannot be read: {error}") from error
