"""Which servos of a bus answer, and what the silence of others means."""

from collections.abc import Callable, Iterator, Sequence

from s2c2a.lab.hardware.bus import BusError, Hearing, ServoBus

ALL_SILENT = (
    "check the power supply, the cable from the adapter to the first servo, the port "
    "(`s2c2a motors scan --port` with another one) and the baud rate "
    "(`s2c2a motors scan --all-rates`)"
)
SOME_SILENT = "check the plug before the first of them, its cable and its id (`s2c2a motors scan`)"
DAMAGED = (
    "two servos may have this id (connect one servo at a time, and give it another one "
    "with `s2c2a motors setup`), or the line is noisy (a loose plug, wires beside motors)"
)
DOUBLED = (
    "two servos have this id; connect one servo at a time, and give it another one with "
    "`s2c2a motors setup`"
)
Place = Callable[[int], str]


def check_presence(
    bus: ServoBus, ids: Sequence[int], place: Place, others: Sequence[int] = ()
) -> None:
    """Check that every servo answers, each once.

    Args:
        bus: of the servos.
        ids: of the servos.
        place: of a servo, for users, such as "module 2, cable 1".
        others: servos of the same bus that are asked only if one of `ids` is silent, to
            find out whether all of them are.

    Raises:
        BusError: servos are silent, damaged or doubled; the message tells these apart.
    """
    hearings = {id: bus.listen(id) for id in ids}
    if Hearing.SILENT in hearings.values():
        hearings |= {id: bus.listen(id) for id in others if id not in hearings}
    if len(hearings) > 1 and set(hearings.values()) == {Hearing.SILENT}:
        raise BusError(
            f"none of the {len(hearings)} servos answers, nothing at all: {ALL_SILENT}"
        )

    def names(wanted: Hearing) -> str:
        found = [id for id, hearing in hearings.items() if hearing is wanted]
        return ", ".join(f"{id} ({place(id)})" for id in found)

    texts = []
    if doubled := names(Hearing.DOUBLED):
        texts.append(f"more than one answer from servo {doubled}: {DOUBLED}")
    if damaged := names(Hearing.DAMAGED):
        texts.append(f"damaged answers from servo {damaged}: {DAMAGED}")
    if silent := names(Hearing.SILENT):
        texts.append(f"no answer from servo {silent}: {SOME_SILENT}")
    if texts:
        raise BusError(". ".join(texts))


def hear(
    exchanges: Callable[[], Iterator[tuple[bytes, int]]], attempts: int
) -> Hearing:
    """Ask a servo until all its answers are clear; otherwise describe all of them.

    Noise spoils single answers, and two servos with one id all of them. An answer may
    be late and follow the next request, but only two servos answer more often than
    they are asked.

    Args:
        exchanges: sends requests one after the other, and yields for each the bytes
            that came back and the number of valid answers in them.
        attempts: how often it is called at most.
    """
    requests = 0
    answers = 0
    is_damaged = False
    for _ in range(attempts):
        is_clear = True
        for heard, count in exchanges():
            requests += 1
            answers += count
            is_damaged |= bool(heard) and not count
            is_clear = count == 1
            if not is_clear:
                break
        if is_clear:
            return Hearing.CLEAR
    if answers > requests:
        return Hearing.DOUBLED
    if is_damaged:
        return Hearing.DAMAGED
    return Hearing.CLEAR if answers else Hearing.SILENT
