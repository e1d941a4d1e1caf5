"""Commands that vibrate for long are held for a while, whatever the controller does."""

from dataclasses import dataclass

# Chosen: longer than vibrations that decay; an arm at rest calms down within seconds.
PATIENCE = 6.0  # s of vibration; then the command is held
HOLD_TIME = 2.0  # s


@dataclass(frozen=True)
class VibrationHold:
    """Whether the command is held because it vibrated.

    Attributes:
        vibrating_for: time for which the command has vibrated [s].
        held_for: time for which it is still held [s].
    """

    vibrating_for: float = 0.0
    held_for: float = 0.0

    @property
    def is_held(self) -> bool:
        """Whether the command is held."""
        return self.held_for > 0.0

    def after(self, vibrates: bool, period: float) -> "VibrationHold":
        """The state after one control step.

        Args:
            vibrates: whether the monitor reports that commands vibrate.
            period: of the control steps [s].
        """
        vibrating_for = self.vibrating_for + period if vibrates else 0.0
        if vibrating_for > PATIENCE:
            return VibrationHold(held_for=HOLD_TIME)
        return VibrationHold(vibrating_for, max(self.held_for - period, 0.0))
