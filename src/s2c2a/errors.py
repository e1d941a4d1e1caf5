"""The errors of the package, all under one base."""


class S2C2AError(Exception):
    """Base of every error that a user can cause or mend.

    The message says what was got, what is allowed and what to do next.
    """


class ArmError(S2C2AError):
    """An arm description is impossible, incomplete or of the wrong form."""


class RecordingError(S2C2AError):
    """A recording or an episode cannot be read, written or continued."""


class DamagedRecordingError(RecordingError):
    """A file of episodes is cut off, damaged, or none at all."""


class StrategyError(S2C2AError):
    """A strategy file is damaged, or was trained for another arm."""


class ForeignCodeError(StrategyError):
    """A file of somebody's names code that the user has not asked for."""


class TargetError(S2C2AError):
    """A target or an obstacle is not a finite number of the right shape."""


class ReadingError(S2C2AError):
    """A reading lacks what is needed, or is not plausible."""


class ActionError(S2C2AError):
    """An action is not a finite number of the right shape."""


class TrainingError(S2C2AError):
    """Training cannot start or has failed to learn."""


class ClusterError(S2C2AError):
    """A cluster cannot be reached, is of other versions, or failed."""


class SimulationError(S2C2AError):
    """The simulated arm left the physically possible.

    Attributes:
        step: control step, counted from the last `open`, in which it happened.
        last_states: the last good states, shape (modules, 6), base frame, meters; None
            before the first.
    """

    def __init__(self, message: str, step: int, last_states=None):
        super().__init__(message)
        self.step = step
        self.last_states = last_states

    def __reduce__(self):
        """Errors travel between processes."""
        return type(self), (*self.args, self.step, self.last_states)
