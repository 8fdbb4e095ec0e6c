"""Start-up test of a gate guard: every trip that can be provoked with the gates off."""

from __future__ import annotations

from collections.abc import Iterator

from directmpc.host.board import Board, TrippedError
from directmpc.host.registers import registers_of

#: Time of a decision in this test, clocks: a comparison takes less, every decision more. So the
#: fault `late` keeps the gates off where a comparison does not.
DECISION_LIMIT = 20
WATCHDOG = 100
LONGEST = 0xFFFF
#: The host may be so slow that the watchdog comes first.
ATTEMPTS = 10


class SelfTestError(RuntimeError):
    """A trip did not come when it was provoked: fault and what should have caused it."""

    def __init__(self, lacking: list[str]) -> None:
        super().__init__(f"self-test: the gate guard did not trip: {'; '.join(lacking)}")


def _beyond(board: Board) -> Iterator[tuple[str, str, int]]:
    """Fault, measurement and a word of it just beyond its limit; all other words are inside."""
    limit = board.read("guard.current_limit")["value"]
    # a current along beta is sqrt(3)/2 of it in the phases
    peak = limit * 5 // 4 + 2
    speed = board.read("guard.speed_limit")["value"] + 1
    for sign in (1, -1):
        yield "over_current", "is_alpha", sign * (limit + 1)
        if peak < 2**15:
            yield "over_current", "is_beta", sign * peak
        yield "over_speed", "omega_r", sign * speed
    yield "link_high", "v_dc", board.read("guard.link_high")["value"] + 1
    yield "link_low", "v_dc", board.read("guard.link_low")["value"] - 1
    if board.has_capacitors():
        limit = board.read("bands.v_n_limit")["value"] + 1
        yield "neutral_point", "v_n", limit
        yield "neutral_point", "v_n", -limit
        for phase in "abc":
            yield "capacitor", f"v_ph_{phase}", board.read("bands.v_ph_high")["value"] + 1
            yield "capacitor", f"v_ph_{phase}", board.read("bands.v_ph_low")["value"] - 1


def _inside(board: Board) -> dict[str, int]:
    """Words of a measurement that trips nothing, in port order."""
    names = [name.partition(".") for name in registers_of(board.controller)]
    # the positions, or the vector, come apart from them
    words = {name: 0 for block, _, name in names if block == "measurements"}
    words = {name: 0 for name in words if name != "u" and not name.startswith("s_prev_")}
    ends = (board.read(f"guard.link_{end}")["value"] for end in ("high", "low"))
    words["v_dc"] = sum(ends) // 2
    if board.has_capacitors():
        ends = (board.read(f"bands.v_ph_{end}")["value"] for end in ("high", "low"))
        words |= dict.fromkeys(("v_ph_a", "v_ph_b", "v_ph_c"), sum(ends) // 2)
    return words


def _commit(board: Board, decision_limit: int, watchdog: int) -> None:
    board.write("system.control")  # settings are locked while it is enabled
    board.write("guard.decision_limit", clocks=decision_limit)
    board.write("guard.watchdog", clocks=watchdog)
    board.write("system.command", commit=1)
    board.await_commit()


def self_test(board: Board) -> tuple[str, ...]:
    """Provoke every trip that can come with the gates off; the settings are the same afterwards.

    The inverter's supply has to be off: where the fault `late` does not come, gates come on.
    """
    board.stop()
    if before := board.faults():
        raise TrippedError(before, "self-test")
    kept = {name: board.read(f"guard.{name}") for name in ("decision_limit", "watchdog")}
    inside = _inside(board)
    lacking, came = [], []

    def _provoke(fault: str, cause: str, words: dict[str, int] | None) -> None:
        """Enable, measure, and see whether this fault alone comes."""
        for _ in range(ATTEMPTS):
            board.write("system.control")
            board.write("system.faults", **dict.fromkeys(board.read("system.faults"), 1))
            board.write("system.control", enable=1)
            if words is not None:
                board.exchange(list(words.values()), 0)
            found = board.faults()
            if (found and found != ("missing",)) or fault in found:
                break
        if found == (fault,):
            came.append(fault)
        else:
            lacking.append(f"{fault} with {cause} (found: {', '.join(found) or 'none'})")

    try:
        _commit(board, DECISION_LIMIT, LONGEST)
        for fault, name, word in _beyond(board):
            _provoke(fault, f"{name} = {word}", inside | {name: word})
        _provoke("late", f"a decision limit of {DECISION_LIMIT} clocks", inside)
        _commit(board, LONGEST, WATCHDOG)
        _provoke("missing", f"a watchdog of {WATCHDOG} clocks", None)
    finally:
        _commit(board, *(time["clocks"] for time in kept.values()))
        board.write("system.faults", **dict.fromkeys(board.read("system.faults"), 1))
        board.stop()
    if lacking:
        raise SelfTestError(lacking)
    return tuple(dict.fromkeys(came))
