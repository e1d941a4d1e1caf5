"""Positions over several turns from positions within one turn."""

from collections.abc import Iterable


class TurnCounter:
    """Counts the turns of servos.

    Assumes that a servo turns by less than half a turn between two reads.
    """

    def __init__(self, ticks_per_turn: int):
        """A counter that knows no servo.

        Args:
            ticks_per_turn: of a position.
        """
        self._ticks_per_turn = ticks_per_turn
        self._positions: dict[int, int] = {}

    def unwrap(self, id: int, position: int) -> int:
        """Return the position [ticks] next to the last one; the first stays as it is.

        Args:
            id: of the servo.
            position: within one turn [ticks].
        """
        last = self._positions.get(id, position)
        half = self._ticks_per_turn // 2
        change = (position - last + half) % self._ticks_per_turn - half
        self._positions[id] = last + change
        return last + change

    def forget(self, ids: Iterable[int]) -> None:
        """Begin again with the next position of each servo."""
        for id in ids:
            self._positions.pop(id, None)
