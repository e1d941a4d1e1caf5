"""How much of its feedback a controller may use, after vibrations.

The share falls to a half within a second of a vibration, and to zero if the vibration
goes on. It returns slowly once the vibration has ended; after the second vibration it returns
to less, and so on. Without feedback, commands follow from the goal alone, so they cannot
feed a vibration.
"""

from dataclasses import dataclass, replace

# Chosen: some periods of a first mode near 1 Hz; `s2c2a reproduce stability` tests them.
FADE_TIME = 1.6  # s from all to none
HALF_TIME = 2.0  # s of vibration with half of the feedback; then it falls to none
HALF = 0.5  # of the share, and of the largest one with each vibration after the first
CALM_TIME = 3.0  # s without vibration before the feedback returns
RETURN_TIME = 6.0  # s from none to all
MIN_CEILING = 0.1  # below, feedback stays off
HOLD_AFTER = 3.0  # s of vibration without feedback; then the command is held
HOLD_TIME = 2.0  # s


@dataclass(frozen=True)
class Feedback:
    """State of the feedback.

    Attributes:
        share: of the feedback that the controller may use, 0 to 1.
        ceiling: to which the share returns.
        vibrating: whether the arm vibrates, or did until `CALM_TIME` ago.
        calm_for: time since the last vibration [s].
        half_for: time of vibration with half of the feedback [s].
        without_for: time of vibration without any feedback [s].
        hold_for: time for which the command is still held [s].
        count: number of vibrations so far.
    """

    share: float = 1.0
    ceiling: float = 1.0
    vibrating: bool = False
    calm_for: float = 0.0
    half_for: float = 0.0
    without_for: float = 0.0
    hold_for: float = 0.0
    count: int = 0

    @property
    def is_held(self) -> bool:
        """Whether the command is held, since it vibrates without feedback."""
        return self.hold_for > 0.0

    def after(self, vibrates: bool, period: float) -> "Feedback":
        """Return the state after one control step.

        Args:
            vibrates: whether the monitor reports a vibration in this step.
            period: of the control steps [s].
        """
        calm_for = 0.0 if vibrates else self.calm_for + period
        began = vibrates and not self.vibrating
        vibrating = vibrates or (self.vibrating and calm_for < CALM_TIME)
        ceiling = self._reduced_ceiling() if began else self.ceiling
        half_for = 0.0
        if vibrating:
            half_for = self.half_for + period * (vibrates and self.share <= HALF)
            least = 0.0 if half_for > HALF_TIME else min(HALF, self.share)
            share = max(self.share - period / FADE_TIME, least)
        else:
            share = min(self.share + ceiling * period / RETURN_TIME, ceiling)
        is_open_loop = vibrates and self.share <= 0.0
        without_for = self.without_for + period if is_open_loop else 0.0
        hold_for = max(self.hold_for - period, 0.0)
        if without_for > HOLD_AFTER:
            hold_for, without_for = HOLD_TIME, 0.0
        return replace(
            self,
            share=share,
            ceiling=ceiling,
            vibrating=vibrating,
            calm_for=calm_for,
            half_for=half_for,
            without_for=without_for,
            hold_for=hold_for,
            count=self.count + began,
        )

    def _reduced_ceiling(self) -> float:
        if self.count == 0:
            return self.ceiling
        ceiling = HALF * self.ceiling
        return ceiling if ceiling >= MIN_CEILING else 0.0
