"""The netlists that bitstreams are made of, to the byte, driven by the host's own package.

`test_board` has a faster UART, and with it another netlist; here are the boards' own generics:
their UART's rate and their oscillator's divider.

Sweep: every build of the ULX3S, both controllers and the one with every method of MPTC; MPTC with
the divider by 4 (Arty S7-50) and by 2 with the RS-232 rate (Spartan-3); the text of all boards'
netlists. Steps over the UART, and over SPI for MPTC.
Stimulus: closed loops over the pseudo-terminal: MPDCC 200 steps of the 6 kV drive, 60 with SESE, a
budget, delay compensation and the weighted deadlock rule; MPTC 150 steps, MPFC 50; MPFC3 50
with the speed measured and 50 with it estimated; corrupted frames with the gates on; a second
start.
Checks: the text is what the bitstream's synthesis reads; identity, version, capabilities,
registers read back; every decision against the bit-true model, a sample of MPDCC's against replay
by the RTL, clocks included; flags, cycles, counters of decisions and frames, gates; a corrupted
frame changes no gate; gates are off from the start on, while the PLL is not locked, and while
clock_monitor finds its clock too slow; each module is the same text as in the other
boards' netlists and in the cores that are proven alone; with a part of a signal lost all this turns
red.
Does not prove: anything about synthesis after the conversion, nor about a vendor's tools.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from directmpc.api.drive_file import AnyDrive, load_drive
from directmpc.host import gate_guard, lockstep
from directmpc.host import protocol as p
from directmpc.host.board import Board, TrippedError
from directmpc.host.link import Link, SerialStream
from directmpc.host.protocol import Decision, Flag, Frame, Outcome, Splitter, Type
from directmpc.host.registers import RegisterValues, registers_of, values
from directmpc.mpdcc import trace
from directmpc.mpdcc.trace import MpdccTrace
from directmpc.mptc import cycles as clocks_of_mptc
from directmpc.mptc.drive import MptcDrive
from scripts.hdl import conversion as netlist
from scripts.hdl import virtual_board
from scripts.hdl.boards import BOARDS
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.hdl.virtual_board import Script, VirtualBoard
from scripts.measure import bitstream
from scripts.shared.tools import Generics
from tb.rtl.boards.board_steps import (
    MPDCC,
    MPTC,
    Hostile,
    exhausted_of,
    replayed,
    rows_of,
    script_gates,
)

ULX3S = BOARDS["ulx3s-85f"]
STEPS = {"mpdcc": 200, "kbest": 60, "mptc": 150}
DRIVES = {"mpdcc": MPDCC, "kbest": "anpc5l_6kv_kbest", "mptc": MPTC}
OPTIONS = 60  # steps of MPDCC with every option of the second level
BUDGET = 300
SAMPLE = 15  # decisions of MPDCC that the RTL in GHDL makes as well
BUILDS = [(name, controller) for name, b in BOARDS.items() for controller in b.controllers]


#: Beginnings of names of modules that a board without some options of MPDCC has otherwise, or not.
LEFT_OUT = ("mpdcc_core_", "state_observer", "parameter_memory", "mac_sequencer_", "mac_block_")

#: Modules that count in clocks, or hold one that does: boards with another clock have others.
CLOCKED = {
    "clock_monitor", "frame_receiver", "gate_guard", "gate_supervisor", "host_link",
    "link_executor", "mpdcc_system", "mptc_system", "ram", "reply_source", "system_shell",
    "uart_receiver", "uart_transmitter",
}  # fmt: skip


class Recorder(Board):
    """A board that keeps what was asked of it and what it answered."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.steps: list[tuple[list[int], int, Decision]] = []

    def exchange(self, words: list[int], position: int, count: int | None = None) -> Decision:
        """As the board does."""
        answer = super().exchange(words, position, count)
        self.steps.append((words, position, answer))
        return answer


def loaded(board: Board, drive: AnyDrive, *, back: bool = True) -> RegisterValues:
    """A drive's registers, written, committed and read back."""
    capabilities = board.read("system.capabilities")
    built = [name for name in ("family", "sensorless") if capabilities.get(name)]
    found = values(drive, clock=float(board.identity.clock), built=built)
    found.words |= {"guard.decision_limit": 0xFFFF, "guard.watchdog": 0xFFFF}
    board.load(found)
    assert not back or board.differing(found) == []
    assert not board.read("system.status")["commit_pending"]
    return found


def gates_of(controller: str, answer: Decision) -> int:
    """Gates that are on in the decided position, as the port has them."""
    if controller == "mptc":
        legs, tabled_leg = [answer.position >> 5 - x & 1 for x in range(3)], False
    else:
        legs, tabled_leg = list(answer.positions), True
    on = [gate_guard.gates_of(tabled_leg, leg) for leg in legs]
    size = 8 if tabled_leg else 2
    return sum(1 << size * x + gate - 1 for x, gates in enumerate(on) for gate in gates)


def check_facts(board: Board, chosen: Generics) -> None:
    """Who it says it is, on the link and in its registers."""
    mpdcc, mptc = chosen["CONTROLLER"] == 1, chosen["CONTROLLER"] == 2
    who = board.identity
    assert (board.controller == "mpdcc", board.controller == "mptc") == (mpdcc, mptc)
    assert who.version == p.VERSION
    assert who.explorers == (chosen["EXPLORERS"] if mpdcc else 0)
    assert who.options == 2 + mptc  # controls; MPFC is built in
    assert who.clock == chosen["CLOCK_HZ"]
    assert who.last_sequence == 0
    version = board.read("system.version")
    assert version["map"] >= 1
    assert any(version.values())
    built = board.read("system.capabilities")
    assert built["controller"] == chosen["CONTROLLER"]
    for option in ("second_level", "weighted_deadlock", "inwards"):
        assert built[option] == (mpdcc and chosen.get(option.upper(), True))
    assert built["flux_control"] == mptc
    if mptc:
        for option in ("family", "sensorless"):
            assert built[option] == chosen.get(option.upper(), False)
    assert built["least_dead_time"] == -(-400 * int(chosen["CLOCK_HZ"]) // 10**9)  # 400 ns
    status = board.read("system.status")
    assert [name for name, value in status.items() if value] == ["in_force", "second_clock"]
    assert board.read("system.gates")["gates"] == 0


def check_corruption(board: Recorder, stream: SerialStream, log: Path) -> Counter[Outcome]:
    """Frames that would stop the gates or move them, each with a fault; outcomes they must have."""
    words = board.steps[-1][0]

    def kept_alive() -> int:
        """The watchdog wants a decision; gates after it."""
        position = board.steps[-1][2].position & (7 if board.controller == "mptc" else 0x1FF)
        board.exchange(words, position)
        return board.read("system.gates")["gates"]

    control = registers_of(board.controller)["system.control"][0]
    judged = []
    for ahead, frame in enumerate((
        Frame(Type.WRITE, 0, struct.pack("<HI", control, 0)),
        Frame(Type.STEP, 0, p.step_payload([w ^ 0x7F55 for w in words], 0, 1)),
    )):  # fmt: skip
        wire = replace(frame, sequence=board.link.sequence + 100 + ahead).wire()[1:-1]
        crc, last = len(wire) - 2, len(wire) - 1
        changed = [bytearray(wire) for _ in range(2)]
        changed[0][crc] ^= 0x10
        changed[1][last] ^= 0x81
        # one at a time: with two the longest watchdog lapses at 100 MHz
        for broken in (*map(bytes, changed), wire[:last], wire + b"\x55"):
            line = b"\0" + broken + b"\0"
            # a changed byte may have become a delimiter: what the board sees are the parts between
            parts = [p.judge(part) for part in Splitter().feed(line)]
            assert parts
            judged += parts
            gates = kept_alive()
            assert gates
            told = log.read_text()
            stream.write(line)
            assert board.read("system.gates")["gates"] == gates
            assert log.read_text() == told
    assert all(frame is None for _, frame in judged)
    assert any(outcome is Outcome.CRC for outcome, _ in judged)
    kept_alive()
    assert board.read("system.status")["running"]
    return Counter(outcome for outcome, _ in judged)


def sample_of(seen: MpdccTrace, cycles: np.ndarray) -> np.ndarray:
    """Rows that the RTL replays: the slowest, and others."""
    rest = np.random.default_rng(1).permutation(len(cycles))[: SAMPLE - 1]
    return np.unique(np.append(rest, cycles.argmax()))


def prove(
    running: VirtualBoard,
    chosen: Generics,
    log: Path,
    scale: float = 1.0,
    folder: Path | None = None,
) -> None:
    """Everything that a client can ask of a board that has just been started."""
    stream = SerialStream(str(running.port), 3_000_000)
    try:
        board = Recorder(Link(stream, 10.0))
        check_facts(board, chosen)
        name = board.controller
        steps = int(STEPS[name] * scale)
        drive = load_drive(DRIVES[name])
        loaded(board, drive)
        assert board.read("system.commits")["count"] == 2  # the first is the reset's
        assert log.read_text() == "clock,gates\n"
        # counters are read with the gates off: that takes longer than the watchdog waits
        before, asked = board.counters(), board.link.sequence
        with lockstep.gates_enabled(board):
            if name != "mptc":
                run, seen, decisions = lockstep.run_mpdcc(board, drive, 1.0, steps, "fast")
                told = [answer.has(Flag.DEADLOCK) for _, _, answer in board.steps]
                assert told == decisions.deadlock.astype(bool).tolist()
            else:
                run = lockstep.run_mptc(board, drive, 1000.0, 5.0, 0.7, steps)
            # MPTC's decision reaches the gates with the next start
            _, _, applied = board.steps[-2 if name == "mptc" else -1]
            assert run.differing == 0
            assert board.read("system.gates")["gates"] == gates_of(name, applied)
            status = board.read("system.status")
            assert (status["running"], status["enabled"], status["fault"]) == (1, 1, 0)
            judged = check_corruption(board, stream, log)
        asked = board.link.sequence - asked
        after = board.counters()
        outcomes = Counter({o: after[o] - before[o] for o in after if after[o] > before[o]})
        # looking takes two requests, and the first tells this count: two of them lie between
        assert outcomes.pop(Outcome.ACCEPTED) == asked + 2
        assert outcomes == judged
        assert run.faults == 0
        assert run.running[2:].all()
        flags = board.read("system.flags")
        answers = [answer for _, _, answer in board.steps]
        assert flags["deadlock"] == any(answer.has(Flag.DEADLOCK) for answer in answers)
        assert flags["saturated"] == any(answer.has(Flag.SATURATED) for answer in answers)
        assert flags["clamped"] == any(answer.has(Flag.CLAMPED) for answer in answers)
        assert flags["start_ignored"] == 0
        cycles = [answer.cycles for answer in answers]
        assert cycles[:steps] == run.cycles.tolist()
        assert board.read("system.cycles") == {"last": cycles[-1], "worst": max(cycles)}
        assert board.read("system.decisions")["count"] == len(answers)
        assert board.read("system.gates")["gates"] == 0
        assert log.read_text().splitlines()[-1].endswith(",000000")
        if name == "mpdcc":
            check_options(board, int(OPTIONS * scale))
            if folder is not None:
                check_replay(folder, seen, decisions, run)
        elif name == "mptc" and scale == 1.0:
            flux = drive.with_control(method="MPFC")
            loaded(board, flux)
            assert lockstep.run_mptc(board, flux, 1000.0, 5.0, 0.7, 50).differing == 0
            if chosen.get("FAMILY"):
                check_family(board, drive)
        counters = board.counters()
        assert counters[Outcome.ACCEPTED] > steps
        line = float(log.read_text().splitlines()[-1].split(",")[0])
        print(f"{name}: {steps} steps, {run.rate:.0f} a second; {line:.0f} clocks until gates off")
    finally:
        stream.close()


def check_family(board: Board, drive: MptcDrive) -> None:
    """Three vectors a period, with the speed measured and estimated; two of the cheaper duty."""
    for method, rule, sensorless in (
        ("MPFC3", "deadbeat", False), ("MPFC3", "deadbeat", True), ("MPTC2", "best", False),
    ):  # fmt: skip
        several = drive.with_control(method=method, duty_rule=rule)
        clocks = clocks_of_mptc.of(method, rule) + clocks_of("mptc_speed_observer", "speed")
        board.load(several, sensorless=sensorless)
        lockstep.warm_up(several)
        with lockstep.gates_enabled(board):
            run = lockstep.run_mptc(board, several, 1000.0, 5.0, 0.7, 50, sensorless=sensorless)
        assert run.differing == 0
        assert (run.faults, board.read("result.sequencer")["invalid"]) == (0, 0)
        assert set(run.cycles.tolist()) == {clocks}


def check_options(board: Board, steps: int) -> None:
    """SESE with a budget, delay compensation and the weighted deadlock rule, decisions alike."""
    drive = load_drive(MPDCC).with_control(
        switching_horizon="SESE", budget=BUDGET, delay_compensation=True, deadlock_rule="weighted",
    )  # fmt: skip
    loaded(board, drive)
    run, seen, decisions = lockstep.run_mpdcc(board, drive, 1.0, steps, "fast")
    assert run.differing == 0
    wanted = exhausted_of(drive, seen)
    assert decisions.exhausted is not None
    assert decisions.exhausted.tolist() == wanted
    assert sum(wanted) > 0
    assert run.cycles.max() > worst_cycles("fast", 1)


def check_replay(
    folder: Path, seen: MpdccTrace, decisions: trace.Decisions, run: lockstep.LockStep
) -> None:
    """`make replay` by the RTL in GHDL writes the same for a sample, clocks included."""
    trace.write_decisions(folder / "board.csv", replace(decisions, exhausted=None))
    told = rows_of(folder / "board.csv")
    some = sample_of(seen, run.cycles)
    assert [told[0], *(told[1 + k] for k in some)] == replayed(folder, "rtl", seen.rows(some))


def synthesised(controller: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What `make bitstream` gives to Yosys; Yosys itself is left out."""
    read: list[Path] = []
    monkeypatch.setattr(bitstream, "map_netlist", lambda verilog, *_, **__: read.append(verilog))
    bitstream.synthesise(ULX3S, controller, 1, folder)
    return read[0]


@pytest.mark.parametrize("controller", ["mpdcc", "kbest", "mptc", "family"])
def test_the_bitstreams_netlist_controls_a_drive(
    controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = ULX3S.generics(controller)
    log = tmp_path / "gates.csv"
    verilog = synthesised(controller, tmp_path, monkeypatch)
    with VirtualBoard(chosen, tmp_path / "board", log, verilog=verilog) as running:
        prove(running, chosen, log, folder=tmp_path)
    # configured anew, with other contents of what has no reset: nothing is left of all that
    for seed in (2, 3):
        with Script(chosen, seed) as script:
            script.wait(5000)
            assert all(seen.gates == 0 and seen.changes == 0 for seen in script.run())
        with VirtualBoard(chosen, tmp_path / "board", log, seed) as running:
            stream = SerialStream(str(running.port), 3_000_000)
            board = Board(Link(stream, 10.0))
            check_facts(board, chosen)
            answer = board.exchange([0] * p.STEP_WORDS[board.identity.controller], 0)
            assert not answer.has(Flag.ENABLED)
            assert answer.gates == 0
            stream.close()
        assert log.read_text() == "clock,gates\n"


def test_without_a_locked_pll_no_gate_is_on(tmp_path: Path) -> None:
    lost, back = 200_000, 300
    clock = tmp_path / "clock.v"
    text, count = re.subn(
        r"assign locked = 1'b1;",
        f"reg [31:0] age = 0; always @(posedge clock) age <= age + 1;\n"
        f"  assign locked = age < {lost} || age >= {lost + back};",
        virtual_board.CLOCK.read_text(encoding="utf-8"),
    )
    assert count == 1
    clock.write_text(text, encoding="utf-8")
    with Script(ULX3S.generics("mptc"), clock=clock) as script:
        board = Hostile(script, True, ULX3S.core_mhz("mptc") * 1e6)
        fresh = board.read("system.control"), board.read("system.commits")
        position = board.run_up().position & 7
        assert (board.read("system.control"), board.read("system.commits")) != fresh
        here = 0
        while here < lost - 20_000:  # the watchdog wants decisions
            position = board.step(position).position & 7
            script.wait(2000)
            here = script.run()[-1].clock
        script.wait(lost - here - 10)
        script.wait(30)
        before, after = script.run()
        assert (before.gates != 0, after.gates) == (True, 0)
        script.wait(back + 5000)
        seen = script.run()[-1]
        assert (seen.gates, seen.changes) == (0, 0)
        # the whole board has begun anew
        board.number = p.first_sequence(1)
        assert (board.read("system.control"), board.read("system.commits")) == fresh
        assert board.step(0).faults == 0
        assert script_gates(board) == 0


def test_a_clock_that_clock_monitor_finds_too_slow_lets_no_gate_on(tmp_path: Path) -> None:
    clock = tmp_path / "clock.v"
    text, count = re.subn(
        "CORE_MHZ / 5 - 1", "CORE_MHZ / 10 - 1", virtual_board.CLOCK.read_text(encoding="utf-8")
    )  # the second oscillator counts twice as many clocks: the first has half its frequency
    assert count == 1
    clock.write_text(text, encoding="utf-8")
    with Script(ULX3S.generics("mptc"), clock=clock) as script:
        board = Hostile(script, True)
        board.send(Frame(Type.IDENTIFY, board.number + 1, b"").wire(), 70)
        script.wait(20_000)
        assert not any(any(seen.spi) or seen.gates for seen in script.run())


def test_the_netlist_with_a_divided_clock_controls_a_drive(tmp_path: Path) -> None:
    chosen = BOARDS["arty-s7-50"].generics("mptc")
    log = tmp_path / "gates.csv"
    with VirtualBoard(chosen, tmp_path / "board", log) as running:
        prove(running, chosen, log, scale=0.1)


@pytest.mark.parametrize("controller", ["mpdcc", "mptc"])
def test_the_netlist_with_an_rs232_rate_decides_but_its_watchdog_wants_spi(
    controller: str, tmp_path: Path
) -> None:
    chosen = BOARDS["spartan3-starter"].generics(controller)
    log = tmp_path / "gates.csv"
    with VirtualBoard(chosen, tmp_path / "board", log) as running:
        stream = SerialStream(str(running.port), 115_200)
        board = Board(Link(stream, 30.0))
        check_facts(board, chosen)
        if controller == "mpdcc":
            drive = load_drive(MPDCC)
            loaded(board, drive, back=False)  # the decisions show it; reading takes a minute
            run, _, _ = lockstep.run_mpdcc(board, drive, 1.0, 6, "fast")
        else:
            drive = load_drive(MPTC)
            loaded(board, drive)
            run = lockstep.run_mptc(board, drive, 1000.0, 5.0, 0.7, 6)
        # request and reply take 120,000 clocks, of the watchdog's 65,535 at most
        with pytest.raises(TrippedError, match=r"\(missing\)"), lockstep.gates_enabled(board):
            pass
        assert not board.read("system.status")["running"]
        stream.close()
    assert run.differing == 0
    assert log.read_text() == "clock,gates\n"


@pytest.mark.parametrize("name", ["ulx3s-85f", "arty-s7-50", "spartan3-starter"])
def test_steps_over_spi_switch_the_gates_and_permit_stops_them(name: str) -> None:
    with Script(BOARDS[name].generics("mptc")) as script:
        board = Hostile(script, True, BOARDS[name].core_mhz("mptc") * 1e6)
        decision = board.run_up()
        on = script_gates(board)
        assert on == gates_of("mptc", decision)
        wire = bytearray(
            Frame(Type.WRITE, p.first_sequence(1) + 5000, struct.pack("<HI", 0x0C, 0)).wire()
        )
        wire[-3] ^= 0xA5
        board.send(bytes(wire), 40)
        script.wait(2000)
        assert [seen.gates for seen in script.run()] == [on, on]
        assert board.counters()[Outcome.CRC] == 1
        script.permit(False)
        script.wait(4)
        assert script.run()[-1].gates == 0
        assert board.step(0).faults & 1


def modules_of(top: str, chosen: Generics) -> dict[str, str]:
    """Modules of a netlist by name."""
    return netlist.modules(netlist.cached(top, chosen).read_text(encoding="utf-8"))


def core_of(chosen: Generics) -> dict[str, str]:
    """Modules of the core that a board with these generics has, one explorer."""
    options = {
        name: chosen.get(name, True) for name in ("SECOND_LEVEL", "WEIGHTED_DEADLOCK", "INWARDS")
    }
    return modules_of("mpdcc_core", {"EXPLORERS": 1, "FOLDED": False, **options})


def test_a_module_is_the_same_in_every_netlist_that_holds_it() -> None:
    # GHDL 2.0 has lost assignments to parts of a signal where something else in the design changed
    for controller in ("mpdcc", "kbest", "mptc", "family"):
        here = modules_of("board_top", ULX3S.generics(controller))
        for name in (n for n, c in BUILDS if c == controller):
            chosen = BOARDS[name].generics(controller)
            if chosen == ULX3S.generics(controller):
                continue
            there = modules_of("board_top", chosen)
            assert {n for n in here.keys() & there.keys() if here[n] != there[n]} == {"board_top"}
            # what counts in clocks has the clock, or a number of clocks, in its name
            one, other = here.keys() - there.keys(), there.keys() - here.keys()
            if BOARDS[name].left_out:  # another core, the same as alone
                cores = [core_of(ULX3S.generics(controller)), core_of(chosen)]
                assert all(there[n] == text for n, text in cores[1].items() if n in there)
                one, other = (
                    {n for n in only if n not in core and not n.startswith(LEFT_OUT)}
                    for only, core in zip((one, other), cores, strict=True)
                )
            for only in (one, other):
                assert {re.split(r"_\d", name)[0] for name in only} <= CLOCKED
        alone: list[tuple[str, Generics, int]] = [("mptc_core", {"FLUX_CONTROL": True}, 4)]
        if controller == "kbest":
            alone = [("kbest_core", {}, 4)]
        if controller == "family":
            alone = [("mptc_family_core", {}, 20)]
        if controller == "mpdcc":
            options = ("SECOND_LEVEL", "WEIGHTED_DEADLOCK", "INWARDS")
            full = {"FOLDED": False, **dict.fromkeys(options, True)}
            # the first is the board's, the second is proven by test_netlist_core
            alone = [("mpdcc_core", {"EXPLORERS": 1, **full}, 19)]
            alone += [("mpdcc_core", {"EXPLORERS": 2, **full}, 16)]
        for top, generics, least in alone:
            there = modules_of(top, generics)
            common = here.keys() & there.keys()
            assert len(common) >= least
            assert [n for n in common if here[n] != there[n]] == []
            if generics.get("EXPLORERS") != 2:  # the core itself, whose name has its generics here
                (core,) = (text for n, text in here.items() if f"{n}_".startswith(f"{top}_"))
                assert core == there[top]


def test_what_both_controllers_share_is_the_same_in_both() -> None:
    # two builds of the same clock: what counts in clocks is shared too
    builds = ("mpdcc", "mptc")
    one, other = (modules_of("board_top", ULX3S.generics(name)) for name in builds)
    common = one.keys() & other.keys()
    (least,) = {400 * ULX3S.core_mhz(name) / 1000 for name in builds}  # clocks of the dead time
    assert common >= {
        "spi_slave",
        "frame_transmitter",
        f"gate_supervisor_{least:.0f}",
        "write_gate",
    }
    assert {n for n in common if one[n] != other[n]} == {"board_top"}


def test_unnamed_nets_are_all_that_may_differ_in_a_module() -> None:
    text = "module a\n  (input x);\n  assign n{0}_o = x;\n  assign y = n{0}_o;\nendmodule\n"
    assert netlist.modules(text.format(7)) == netlist.modules(text.format(123))
    assert netlist.modules(text.format(7)) != netlist.modules(text.format(7).replace("= x", "= z"))


#: Lost while converting, so to speak: a part of a signal, a condition; and who has to notice.
FAULTS = {
    "mptc": (
        "frame_receiver", r"= \w+ == 32'b11011110101110110010000011100011;", "= 1'b1;",
        "check_corruption",
    ),
    "mpdcc": (
        "length_search", r"assign lanes = (\w+);", r"assign lanes = \1 & ~(861'd65535 << 206);",
        "run.differing == 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("controller", FAULTS)
def test_a_lost_assignment_turns_it_red(controller: str, tmp_path: Path) -> None:
    module, wanted, instead, where = FAULTS[controller]
    chosen = ULX3S.generics(controller)
    text = netlist.cached("board_top", chosen).read_text(encoding="utf-8")
    head, body = re.split(rf"(?=^module {module}\w*$)", text, flags=re.M)
    body, rest = body.split("\nendmodule", 1)
    changed, count = re.subn(wanted, instead, body)
    assert count == 1
    faulty = tmp_path / "faulty.v"
    faulty.write_text(f"{head}{changed}\nendmodule{rest}", encoding="utf-8")
    log = tmp_path / "gates.csv"
    with (
        VirtualBoard(chosen, tmp_path / "board", log, verilog=faulty) as running,
        pytest.raises(AssertionError) as red,
    ):
        prove(running, chosen, log, scale=0.1)
    assert any(where in str(entry.statement) or where == entry.name for entry in red.traceback)
