"""One drives, the others watch."""

from s2c2a.live.session import Session


def test_the_first_drives_and_the_second_watches():
    session = Session()
    session.join(1)
    session.join(2)
    assert session.drives(1)
    assert not session.take(2)
    assert session.present == (1, 2)


def test_a_free_handle_goes_to_whoever_takes_it_and_to_nobody_by_itself():
    session = Session()
    session.join(1)
    session.join(2)
    session.leave(1)
    assert session.driver is None
    assert session.take(2)
    session.give(2)
    assert session.driver is None
    session.join(3)
    assert session.drives(3)


def test_who_is_not_there_takes_nothing():
    session = Session()
    assert not session.take(7)
    session.give(7)
    session.leave(7)
    assert session.driver is None


def test_changes_are_told():
    told = []
    session = Session(lambda: told.append(session.driver))
    session.join(1)
    session.leave(1)
    assert told == [1, None]
