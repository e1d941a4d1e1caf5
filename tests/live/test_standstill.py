"""A control process that stood still moves again only after the driver resumes."""

import multiprocessing
import queue

from s2c2a.live.process import Halted, _obey


class _Control:
    """Records requests; its process stood still."""

    standstill = "the program stood still for 30.0 s"

    def __init__(self):
        self.asked = []

    def ask(self, **request):
        self.asked.append(request["stopped"])


def test_requests_from_before_a_standstill_do_not_move_the_arm():
    ours, theirs = multiprocessing.Pipe()
    for message in (
        ("ask", ({"stopped": False},)),  # sent before the page knew
        ("ask", ({"stopped": False},)),
        ("known", ()),
        ("ask", ({"stopped": True},)),
        ("ask", ({"stopped": False},)),  # the driver pressed Resume
        ("stop", ()),
    ):
        ours.send(message)
    control = _Control()
    messages = queue.Queue()
    _obey(control, theirs, messages)
    assert control.asked == [True, True, True, False]
    assert messages.get_nowait() == Halted(control.standstill)
    assert messages.empty()
