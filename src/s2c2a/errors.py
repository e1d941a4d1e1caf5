"""Exceptions of the package, all derived from one base, and suggestions in them."""

from collections.abc import Collection, Iterable, Sequence
from difflib import get_close_matches

MAX_NAME_LENGTH = 64  # of a name from a user, which may be a whole file
MAX_SHOWN = 5  # names or faults in a sentence; a reader counts no further


class S2C2AError(Exception):
    """Base of all errors that a user can cause or fix.

    The message says what was given, what is allowed and what to do next.
    """


class ArmError(S2C2AError):
    """An arm description is physically impossible, incomplete or malformed."""


class RecordingError(S2C2AError):
    """A recording or an episode cannot be read, written or resumed."""


class DamagedRecordingError(RecordingError):
    """An episode file is truncated, damaged or of another format."""


class StrategyError(S2C2AError):
    """A strategy file is damaged, or belongs to another arm."""


class UntrustedCodeError(StrategyError):
    """A file names custom code that the user has not allowed."""


class TargetError(S2C2AError):
    """A target or an obstacle is not finite, or has the wrong shape."""


class RobotError(S2C2AError):
    """A robot's method failed or returned nonsense; the message names both."""


class ControllerError(S2C2AError):
    """A controller's method failed or returned nonsense; the message names both."""


class ReadingError(S2C2AError):
    """A sensor reading is incomplete or implausible."""


class ActionError(S2C2AError):
    """An action is not finite, or has the wrong shape."""


class TrainingError(S2C2AError):
    """Training cannot start, or has diverged."""


class ClusterError(S2C2AError):
    """A cluster cannot be reached, runs other versions, or has failed."""


class SimulationError(S2C2AError):
    """The simulated arm has reached a physically impossible state.

    Attributes:
        step: control step of the failure, counted from the last `open`.
        last_states: last valid states, shape (modules, 6), base frame, meters; None
            before the first.
    """

    def __init__(self, message: str, step: int, last_states=None):
        super().__init__(message)
        self.step = step
        self.last_states = last_states

    def __reduce__(self):
        """Support pickling, since errors travel between processes."""
        return type(self), (*self.args, self.step, self.last_states)


def counted(count: int, noun: str) -> str:
    """A count with its noun, such as "1 episode" and "2 episodes"."""
    if count == 1:
        return f"1 {noun}"
    plural = noun.removesuffix("y") + "ies" if noun.endswith("y") else noun + "s"
    return f"{count} {plural}"


def listed(texts: Sequence[str], separator: str = ", ") -> str:
    """The first texts in a sentence, and how many more there are."""
    more = len(texts) - MAX_SHOWN
    shown = separator.join(texts[:MAX_SHOWN])
    return f"{shown} and {more} more" if more > 0 else shown


def nearest_name(name: str, known: Iterable[str]) -> str:
    """The known name that a misspelled one may mean; empty if none is similar."""
    by_letters = {each.lower(): each for each in sorted(known, reverse=True)}
    given = name[:MAX_NAME_LENGTH].lower()
    similar = get_close_matches(given, by_letters, n=1)
    return by_letters[similar[0]] if similar else ""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Suggestion behind a misspelled name in a message; empty if none is similar."""
    nearest = nearest_name(name, known)
    return f" (did you mean {nearest}?)" if nearest else ""


def no_such(kind: str, name: str, known: Collection[str]) -> str:
    """Message about a name that is not among the known ones."""
    likely = did_you_mean(name, known)
    return f"no {kind} '{name}'{likely}; choose one of {', '.join(known)}"
