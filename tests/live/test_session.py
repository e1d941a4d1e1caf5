"""One browser drives, the others watch."""

from s2c2a.live.session import DrivingSession


def test_the_first_browser_drives_and_the_second_watches():
    session = DrivingSession()
    session.join(1)
    session.join(2)
    assert session.drives(1)
    assert not session.take(2)
    assert session.present == (1, 2)


def test_released_control_waits_until_a_browser_takes_it_or_joins():
    session = DrivingSession()
    session.join(1)
    session.join(2)
    session.leave(1)
    assert session.driver is None
    assert session.take(2)
    session.release(2)
    assert session.driver is None
    session.join(3)
    assert session.drives(3)


def test_a_disconnected_browser_cannot_take_control():
    session = DrivingSession()
    assert not session.take(7)
    session.release(7)
    session.leave(7)
    assert session.driver is None


def test_changes_are_reported():
    drivers = []
    session = DrivingSession(lambda: drivers.append(session.driver))
    session.join(1)
    session.leave(1)
    assert drivers == [1, None]
