"""Connected browsers: one drives the arm, the others watch."""

from collections.abc import Callable

# labels of the optional parts of the scene
GHOST = "Planned arm"
TRAILS = "Trails"
CLOUD = "Workspace"


class Browsers:
    """The connected browsers and the one that drives.

    Only viser's thread changes them; every thread may read it.

    Attributes:
        driver: client number of the browser that drives, or None.
        present: client numbers of the connected browsers, in order of arrival.
        view: which optional parts of the scene are shown to everybody, by label.
    """

    def __init__(self, on_change: Callable[[], None] = lambda: None):
        """Start without browsers; `on_change` is called when the driver may change."""
        self._on_change = on_change
        self.view = dict.fromkeys((GHOST, TRAILS, CLOUD), True)
        self.present: tuple[int, ...] = ()
        self.driver: int | None = None

    def drives(self, client: int) -> bool:
        """Whether this browser drives."""
        return self.driver == client

    def join(self, client: int) -> None:
        """Add a browser; it drives if no other browser does."""
        self.present = (*self.present, client)
        self.take(client)

    def leave(self, client: int) -> None:
        """Remove a browser; its control stays free until another takes it."""
        self.present = tuple(other for other in self.present if other != client)
        self.release(client)

    def take(self, client: int) -> bool:
        """Take control if nobody drives; returns whether this browser drives now."""
        if self.driver is None and client in self.present:
            self.driver = client
        self._on_change()
        return self.drives(client)

    def release(self, client: int) -> None:
        """Release control if this browser drives."""
        if self.driver == client:
            self.driver = None
        self._on_change()
