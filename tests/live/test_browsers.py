"""One browser drives, the others watch."""

from s2c2a.live.browsers import Browsers


def test_the_first_browser_drives_and_the_second_watches():
    browsers = Browsers()
    browsers.join(1)
    browsers.join(2)
    assert browsers.drives(1)
    assert not browsers.take(2)
    assert browsers.present == (1, 2)


def test_released_control_waits_until_a_browser_takes_it_or_joins():
    browsers = Browsers()
    browsers.join(1)
    browsers.join(2)
    browsers.leave(1)
    assert browsers.driver is None
    assert browsers.take(2)
    browsers.release(2)
    assert browsers.driver is None
    browsers.join(3)
    assert browsers.drives(3)


def test_a_disconnected_browser_cannot_take_control():
    browsers = Browsers()
    assert not browsers.take(7)
    browsers.release(7)
    browsers.leave(7)
    assert browsers.driver is None
