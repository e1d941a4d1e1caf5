"""Who drives: one browser at a time; the others watch and see who has the handle."""

from collections.abc import Callable

# what can be shown beside the arm
GHOST = "Planned arm"
TRAILS = "Trails"
CLOUD = "Workspace"


class Session:
    """The browsers that are there, and the one that drives; changed by one thread alone, viser's, and read by any.

    Attributes:
        driver: the number of the browser that drives, if one does.
        present: the browsers that are there, the longest first.
        view: what is shown beside the arm, to all of them, by its label.
    """

    def __init__(self, on_change: Callable[[], None] = lambda: None):
        """Nobody is there yet; `on_change` is told when somebody takes or leaves the handle."""
        self._on_change = on_change
        self.view = dict.fromkeys((GHOST, TRAILS, CLOUD), True)
        self.present: tuple[int, ...] = ()
        self.driver: int | None = None

    def drives(self, who: int) -> bool:
        """Whether this browser drives."""
        return self.driver == who

    def join(self, who: int) -> None:
        """A browser comes; it drives where nobody else does."""
        self.present = (*self.present, who)
        self.take(who)

    def leave(self, who: int) -> None:
        """A browser goes; the handle it had is free, and nobody has it until somebody takes it."""
        self.present = tuple(one for one in self.present if one != who)
        self.give(who)

    def take(self, who: int) -> bool:
        """Take the handle where it is free; returns whether this browser drives now."""
        if self.driver is None and who in self.present:
            self.driver = who
        self._on_change()
        return self.drives(who)

    def give(self, who: int) -> None:
        """Leave the handle to whoever takes it."""
        self.driver = None if self.driver == who else self.driver
        self._on_change()
