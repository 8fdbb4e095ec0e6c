"""The whole board top in Verilator, through its pins: the host's own program, and hostile lines.

Sweep: both controllers as build options of the same top; UART and SPI; both positions of the
switch; MPTC at 100 MHz too.
Stimulus: closed loops of 200 and 2,000 control steps of the 6 kV drive, of 300 of it with two
switchings and a budget, of 120 with capacitor filters and noise, of 300 with
the estimate of the leakage, of 120 with the rotor-flux observer, and of 300 of a two-level drive,
over the pseudo-terminal of the virtual board; 100,000 corrupted, random, replayed, oversized and
cut off frames over SPI, 200 over UART, with the gates let through; good requests in between;
measurements of any content for MPFC and MPDCC.
Checks: decisions against the bit-true model with every flag of theirs, and against the files that
replay writes from the recorded trace: the model's for all steps, the RTL's, clocks included, for a
sample; no gate changes; every counter; that the request that follows is answered; that all gates
are off after a reset and without permit.
Timing: from the pins; the SPI exchange of a step stays below 32 us.
Does not prove: anything about pads, cables and drivers.
"""

from __future__ import annotations

import random
import struct
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import __main__ as commands
from directmpc.host import lockstep
from directmpc.host import protocol as p
from directmpc.host.board import Board, RegisterError
from directmpc.host.link import Link, RefusedError, SerialStream
from directmpc.host.protocol import Decision, Flag, Frame, Outcome, Splitter, Type
from directmpc.host.registers import registers_of, values
from directmpc.mpdcc import closed_loop, formats, observer, trace
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.errors import DriveErrors
from directmpc.mpdcc.trace import Decisions, IntArray
from directmpc.mpdcc.variants import VARIANTS
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc import cycles
from directmpc.mptc.coefficients import registers as mptc_registers
from directmpc.states import MpdccState
from scripts.generate.protocol_examples import MEASUREMENTS
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.hdl.virtual_board import Script, VirtualBoard, generics
from tb.helpers import mptc_rows
from tb.rtl.boards.board_steps import (
    CLOCK,
    MPDCC,
    MPTC,
    Hostile,
    decided,
    exhausted_of,
    load,
    replayed,
    rows_of,
    script_gates,
)

STEPS = 2000
BUDGET = 300  # candidates of SESE's second level: enough for some searches
HOSTILE = 100_000
#: What the rotor-flux observer takes of a measurement, in its order.
OBSERVED = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r")


def without_cycles(rows: list[list[str]]) -> list[list[str]]:
    """The same without the column `cycles`."""
    at = rows[0].index("cycles")
    return [[*row[:at], *row[at + 1 :]] for row in rows]


def sample_of(decisions: Decisions, size: int) -> IntArray:
    """Rows of each kind a decision can be of, `size` in all or nearly so, in order."""
    kinds = [
        decisions.held == 1,
        decisions.deadlock == 1,
        (decisions.held == 0) & (decisions.deadlock == 0),
    ]
    assert kinds[0].any()
    assert kinds[2].any()
    rng = np.random.default_rng(1)
    picked = [rng.permutation(np.flatnonzero(kind))[: size // len(kinds)] for kind in kinds]
    return np.sort(np.concatenate(picked))


@pytest.mark.parametrize("steps", [STEPS // 10, STEPS])
def test_steps_of_the_6kv_drive_over_the_virtual_board_are_replays(
    tmp_path: Path, steps: int
) -> None:
    drive = load_drive(MPDCC)
    log = tmp_path / "gates.csv"
    with VirtualBoard(generics("mpdcc"), tmp_path / "board", log) as running:
        stream = SerialStream(str(running.port), 3_000_000)
        board = Board(Link(stream))
        assert board.is_mpdcc()
        found = values(drive, clock=CLOCK)
        found.words |= {"guard.decision_limit": 0xFFFF, "guard.watchdog": 0xFFFF}
        board.load(found)
        assert board.differing(found) == []
        with lockstep.gates_enabled(board):
            run, seen, decisions = lockstep.run_mpdcc(board, drive, 1.0, steps, "fast")
        counters = board.counters()
        off = board.read("system.gates")["gates"]
        stream.close()
    assert run.differing == 0
    # replay itself, from files alone: it reads what the board saw and writes what it decides
    trace.write_decisions(tmp_path / "board.csv", replace(decisions, exhausted=None))
    told = rows_of(tmp_path / "board.csv")
    assert len(told) == steps + 1
    # the model has no clock: its file has no cycles, everything else is the same text
    assert without_cycles(told) == without_cycles(replayed(tmp_path, "model", seen))
    # the replay bench has the RTL's clock too
    sample = sample_of(decisions, min(steps // 8, 90))
    assert [told[0], *(told[1 + k] for k in sample)] == replayed(tmp_path, "rtl", seen.rows(sample))
    assert run.cycles.min() >= 21
    assert run.cycles.max() <= worst_cycles("fast", 1)
    assert run.running.all()
    assert run.faults == 0
    assert len(np.unique(run.gates)) > steps // 40
    assert counters[Outcome.ACCEPTED] > steps
    assert sum(counters.values()) == counters[Outcome.ACCEPTED]
    assert off == 0
    assert len(log.read_text().splitlines()) > steps // 400


def test_the_boards_capacitor_filters_are_the_models(tmp_path: Path) -> None:
    drive = load_drive(MPDCC).with_control(
        capacitor_filter=4, delay_compensation=True, outside_rule="inwards"
    )
    profile = closed_loop.constant_profile(drive, closed_loop.OperatingPoint(1.0), 120)
    noise = DriveErrors(noise_current=0.005, noise_voltage=0.0025)
    virtual = VirtualBoard(generics("mpdcc"), tmp_path / "board")
    with virtual as running, Board(running.port) as board:
        board.load(drive)
        # the second run begins where nothing is left of the first
        for _ in range(2):
            controller = lockstep.BoardController(board, drive)
            run = closed_loop.drive_controller(
                drive, controller, profile, 120, errors=noise, filtered=False
            )
            assert controller.differing == 0
        cycles = controller.column(lambda answer: answer.cycles)
        extra = clocks_of("state_observer", "filters")
        held = clocks_of("mpdcc_core", "hold", "fast")
        prediction = clocks_of("mpdcc_core", "prediction_held", "sese")
        assert set(cycles[run.decisions.held == 1]) == {held + prediction + extra}
        # the model beside the board without its filters decides otherwise
        board.write("system.command", reset_observer=1)
        blind = lockstep.BoardController(board, drive.with_control(capacitor_filter=0))
        closed_loop.drive_controller(drive, blind, profile, 120, errors=noise, filtered=False)
        assert blind.differing > 0


def test_the_boards_estimate_of_the_leakage_is_the_models(tmp_path: Path) -> None:
    drive = load_drive(MPDCC).with_control(
        leakage_estimate=True, capacitor_filter=4, delay_compensation=True, outside_rule="inwards"
    )
    leaks = {name: 0.5 * getattr(drive.machine, name) for name in ("xls", "xlr")}
    profile = closed_loop.constant_profile(drive, closed_loop.OperatingPoint(1.0), 300)

    def run(controller: lockstep.BoardController) -> None:
        closed_loop.drive_controller(
            drive, controller, profile, 300, plant_drive=drive.changed(machine=leaks),
            filtered=False,
        )  # fmt: skip

    with (
        VirtualBoard(generics("mpdcc"), tmp_path / "board") as running,
        Board(running.port) as board,
    ):
        board.load(drive)
        controller = lockstep.BoardController(board, drive)
        run(controller)
        assert controller.differing == 0
        assert controller.leakage is not None
        assert board.read("result.leakage")["theta"] == controller.leakage.theta
        assert controller.leakage.theta > 1.02 * 2**16
        # a model whose theta rests decides otherwise
        blind = lockstep.BoardController(board, drive)
        assert blind.leakage is not None
        blind.leakage.coefficient[:] = 0
        run(blind)
        assert blind.differing > 0


class _Watched(lockstep.BoardController):
    """Counts the steps after which the board's rotor flux is not its observer's twin's."""

    def __init__(self, board: Board, drive: Drive) -> None:
        super().__init__(board, drive)
        self.coefficients = observer.array(observer.coefficients(drive)[0])
        self.state = np.zeros(observer.STATE_WORDS, dtype=np.int64)
        self.other = 0
        self.fluxes: set[tuple[int, int]] = set()

    def decide(self, state: MpdccState) -> lockstep.Decision:
        words, *_ = self._encoder.words(state)
        measured = dict(zip(formats.MEASUREMENTS, words, strict=True))
        found = super().decide(state)
        flux = observer.step_words(
            self.coefficients,
            self.state,
            np.array([measured[name] for name in OBSERVED]),
            np.array(state.applied),
        )[:2]
        shown = self.board.read("result.rotor_flux")
        wanted = {
            name: int(value) & 0xFFFF for name, value in zip(("alpha", "beta"), flux, strict=True)
        }
        self.other += {name: value & 0xFFFF for name, value in shown.items()} != wanted
        self.fluxes.add((int(flux[0]), int(flux[1])))
        return found


def test_the_boards_rotor_flux_is_the_observers(tmp_path: Path) -> None:
    drive = load_drive(MPDCC).with_control(capacitor_filter=0)
    profile = closed_loop.constant_profile(drive, closed_loop.OperatingPoint(1.0), 120)
    with (
        VirtualBoard(generics("mpdcc"), tmp_path / "board") as running,
        Board(running.port) as board,
    ):
        board.load(drive)
        board.write("system.command", reset_observer=1)
        board.write("system.control", use_observer=1)
        watched = _Watched(board, drive)
        closed_loop.drive_controller(drive, watched, profile, 120)
    assert watched.other == 0
    assert len(watched.fluxes) > 100


def test_the_link_tells_that_a_budget_ended_the_search(tmp_path: Path) -> None:
    drive = load_drive(MPDCC).with_control(switching_horizon="SESE", budget=BUDGET)
    with VirtualBoard(generics("mpdcc"), tmp_path / "board") as running:
        stream = SerialStream(str(running.port), 3_000_000)
        board = Board(Link(stream))
        board.load(values(drive, clock=CLOCK))
        board.write("system.control", enable=0, own_positions=0)
        run, seen, decisions = lockstep.run_mpdcc(board, drive, 1.0, 300, "fast")
        stream.close()
    assert run.differing == 0
    wanted = exhausted_of(drive, seen)
    # what it tells, and what the file of the host's command says
    path = tmp_path / "board.csv"
    trace.write_decisions(path, decisions)
    told = trace.read_decisions(path).exhausted
    assert told is not None
    assert told.tolist() == wanted
    searched = decisions.held == 0
    assert 5 < told.sum() < searched.sum()


def test_the_two_level_drive_runs_on_the_same_top(tmp_path: Path) -> None:
    drive = load_drive(MPTC)
    with VirtualBoard(generics("mptc"), tmp_path / "board") as running:
        stream = SerialStream(str(running.port), 3_000_000)
        board = Board(Link(stream))
        assert board.controller == "mptc"
        found = values(drive, clock=CLOCK)
        found.words |= {"guard.decision_limit": 0xFFFF, "guard.watchdog": 0xFFFF}
        board.load(found)
        assert board.differing(found) == []
        with lockstep.gates_enabled(board):
            run = lockstep.run_mptc(board, drive, 1000.0, 5.0, 0.7, 300)
        stream.close()
    assert run.differing == 0
    assert run.faults == 0
    assert run.running[1:].all()
    assert set(run.cycles) == {39}


#: Method with its duty rule, whether the speed is estimated, control periods, and how many changes
#: of the gates there are at least; None: they are not let through. An observer that begins beside a
#: turning machine lets MPTC's current rise above the trip level. MPTC and MPFC make 71 changes
#: in 40 periods.
SEVERAL = [
    ("MPFC3", "deadbeat", False, 120, 400), ("MPTC2", "best", False, 120, 400),
    ("SVM", "deadbeat", True, 120, 400), ("MPTC", "deadbeat", True, 120, None),
    ("MPTC1", "deadbeat", False, 40, 120), ("GTV", "deadbeat", False, 40, 120),
    ("MPFC2", "deadbeat", False, 40, 75), ("MPC2", "deadbeat", False, 40, 120),
]  # fmt: skip


@pytest.mark.parametrize(("method", "rule", "sensorless", "periods", "changes"), SEVERAL)
def test_methods_of_two_and_three_vectors_run_on_the_virtual_board(
    tmp_path: Path, method: str, rule: str, sensorless: bool, periods: int, changes: int | None
) -> None:
    gates = changes is not None
    drive = load_drive(MPTC).with_control(method=method, duty_rule=rule)
    chosen = generics("mptc", family=True, sensorless=True)
    with VirtualBoard(chosen, tmp_path / "board", tmp_path / "gates.csv") as running:
        stream = SerialStream(str(running.port), 3_000_000)
        board = Board(Link(stream))
        board.load(drive, sensorless=sensorless)
        lockstep.warm_up(drive)
        with lockstep.gates_enabled(board) if gates else nullcontext():
            run = lockstep.run_mptc(board, drive, 1000.0, 5.0, 0.7, periods, sensorless=sensorless)
        invalid = board.read("result.sequencer")["invalid"]
        stream.close()
    assert run.differing == 0
    assert (run.faults, invalid) == (0, 0)
    assert run.running[1:].all() == gates
    clocks = cycles.of(method, rule) + clocks_of("mptc_speed_observer", "speed")
    assert set(run.cycles) == {clocks}
    # several vectors a period: more changes of the gates than a vector a period makes
    if changes is not None:
        lines = (tmp_path / "gates.csv").read_text(encoding="ascii").splitlines()
        assert len(lines) > changes


def test_a_board_without_a_method_refuses_it(tmp_path: Path) -> None:
    drive = load_drive(MPTC).with_control(method="GTV")
    with VirtualBoard(generics("mptc"), tmp_path / "board") as running:
        board = Board(str(running.port))
        with pytest.raises(RegisterError, match=r"parameters\.family_method.* lack family"):
            board.load(drive)
        with pytest.raises(RegisterError, match=r"parameters\.sensorless.* lack sensorless"):
            board.load(load_drive(MPTC), sensorless=True)


def test_times_and_rates_follow_the_clock(tmp_path: Path) -> None:
    clock = 100_000_000
    chosen = generics("mptc") | {"CLOCK_HZ": clock, "BAUD": clock // 4}
    drive = load_drive(MPTC)
    with VirtualBoard(chosen, tmp_path / "board") as running:
        stream = SerialStream(str(running.port), 3_000_000)
        board = Board(Link(stream))
        assert board.identity.clock == clock
        assert board.read("system.capabilities")["least_dead_time"] == 40  # 400 ns
        found = values(drive, clock=clock)
        assert found.words["guard.dead_time"] == 200  # 2 us
        found.words |= {"guard.decision_limit": 0xFFFF, "guard.watchdog": 0xFFFF}
        board.load(found)
        assert board.differing(found) == []
        with lockstep.gates_enabled(board):
            run = lockstep.run_mptc(board, drive, 1000.0, 5.0, 0.7, 60)
        stream.close()
    assert run.differing == 0
    assert run.faults == 0
    assert run.running[1:].all()
    assert set(run.cycles) == {39}


def test_the_host_command_closes_the_loop(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    with VirtualBoard(generics("mptc"), tmp_path / "board") as running:
        port = ["--port", str(running.port)]
        assert commands.main([*port, "identify"]) == 0
        assert commands.main([*port, "run", str(MPTC), "--steps", "20", "--gates"]) == 0
        assert commands.main([*port, "read", "system.status"]) == 0
        assert commands.main([*port, "monitor", "--count", "1"]) == 0
        shown = capsys.readouterr().out
        assert "MPTC" in shown
        assert "20 in" in shown
        # errors: one line, nothing else
        for wrong, reason in (
            (["load", str(MPDCC)], "the drive file is for mpdcc, the board has mptc"),
            (["read", "system.nothing"], "no register 'system.nothing'; "),
            (["write", "guard.dead_time", "value=60"], "no field 'value'; it has clocks"),
            (
                ["write", "system.status", "busy=1"],
                "system.status: write to 0x014: there is no such",
            ),
        ):
            assert commands.main([*port, *wrong]) == 2
            said = capsys.readouterr().err
            assert reason in said
            assert len(said.splitlines()) == 1
    assert commands.main(["--port", str(tmp_path / "none"), "identify"]) == 2
    assert "cannot be opened" in capsys.readouterr().err


# ---------------------------------------------------------------------------------------------
# Hostile lines
# ---------------------------------------------------------------------------------------------


def hostile_frame(rng: random.Random, good: list[bytes]) -> tuple[bytes, Outcome]:
    """Bytes between two delimiters that must not act, and what they have to count as."""
    while True:
        kind = rng.random()
        wire = bytearray(rng.choice(good)[1:-1])
        if kind < 0.35:  # bits turned
            for _ in range(rng.choice([1, 1, 1, 2, 5])):
                wire[rng.randrange(len(wire))] ^= 1 << rng.randrange(8)
        elif kind < 0.45:  # bytes lost
            at = rng.randrange(len(wire))
            del wire[at : at + rng.choice([1, 1, 2, 9])]
        elif kind < 0.55:  # bytes added
            at = rng.randrange(len(wire))
            wire[at:at] = rng.randbytes(rng.choice([1, 1, 3]))
        elif kind < 0.75:  # random bytes, at times with a frame's form
            body = rng.randbytes(rng.randrange(1, 24))
            if len(body) > 6 and rng.random() < 0.5:
                body = bytes([rng.choice(list(Type)), max(0, len(body) - 10)]) + body[2:]
            wire = bytearray(p.stuff(body))
        elif kind < 0.77:  # oversized
            wire = bytearray(rng.randrange(1, 256) for _ in range(rng.randrange(44, 120)))
        elif kind < 0.84:  # nothing but noise
            wire = bytearray(rng.choice([0x01, 0xFF, 0x55]) for _ in range(rng.randrange(1, 30)))
        # the rest: as it was sent before, a replay
        bytes_of_it = bytes(wire)
        if not bytes_of_it or 0 in bytes_of_it:
            continue
        outcome, frame = p.judge(bytes_of_it)
        if frame is None:
            return bytes_of_it, outcome
        if bytes([0, *bytes_of_it, 0]) in good:
            return bytes_of_it, Outcome.STALE


@pytest.mark.parametrize(("spi", "count"), [(True, HOSTILE), (False, 200)], ids=["spi", "uart"])
def test_hostile_frames_change_no_gate_and_cost_nothing_after_them(spi: bool, count: int) -> None:
    rng = random.Random(count)
    with Script(generics("mptc")) as script:
        board = Hostile(script, spi)
        decision = board.run_up()
        on = script_gates(board)
        assert on != 0
        # what has been acted upon: to be replayed
        position = decision.position & 7
        # of this link, and of the other
        numbers = [p.first_sequence(link) + n for link in (0, 1) for n in range(1, 9)]
        payload = p.step_payload([8] * 8, position, 0)
        good = [Frame(Type.STEP, n, payload).wire() for n in numbers[::7]]
        good += [Frame(Type.WRITE, n, struct.pack("<HI", 0x0C, 0)).wire() for n in numbers]
        expected = board.counters()
        expected[Outcome.ACCEPTED] += 2  # those that asked for the counters
        seen = 0
        alive = 0
        while seen < count:
            part = min(rng.randrange(1, 60 if spi else 12), count - seen)
            for _ in range(part):
                wire, outcome = hostile_frame(rng, good)
                expected[outcome] += 1
                if spi and rng.random() < 0.1:
                    # chip select goes up within it: what had come so far does not count for more
                    cut = wire[: rng.randrange(1, len(wire) + 1)]
                    expected[outcome] -= 1
                    expected[Outcome.LINE] += 1
                    board.send(b"\0" + cut)
                else:
                    board.send(b"\0" + wire + b"\0", 26 if outcome is Outcome.STALE else 0)
                if not spi:
                    script.wait(2400)
            orders = script.run()
            seen += part
            assert sum(order.changes for order in orders) == 0
            assert orders[-1].gates == on
            # the very next request is served
            identity = p.Identity.unpack(board.request(Type.IDENTIFY))
            expected[Outcome.ACCEPTED] += 1
            alive += 1
            assert identity.version == p.VERSION
            if rng.random() < 0.02 or seen == count:
                assert board.counters() == +expected
                expected[Outcome.ACCEPTED] += 2
            # the guard's watchdog is alive all the while: the same decision again keeps it content
            board.number = max(board.number, p.first_sequence(int(spi)) + 1000)
            assert board.step(decision.position & 7).position == decision.position
            expected[Outcome.ACCEPTED] += 1
        assert seen == count
        assert alive > count // 60
        rejected = {o for o in expected if expected[o]} - {Outcome.ACCEPTED}
        assert rejected >= {Outcome.SHORT, Outcome.CRC, Outcome.STALE}
        if count == HOSTILE:
            assert rejected >= set(Outcome) - {
                Outcome.ACCEPTED, Outcome.LATE, Outcome.BUSY, Outcome.TYPE, Outcome.LINK,
                Outcome.POSITION, Outcome.REPEATED,
            }  # fmt: skip


def test_gates_are_off_after_reset_without_permit_and_without_decisions() -> None:
    with Script(generics("mptc")) as script:
        script.wait(2000)
        assert all(seen.gates == 0 and seen.changes == 0 for seen in script.run())
        board = Hostile(script, True)
        assert script_gates(board) == 0
        board.run_up()
        assert script_gates(board) != 0
        # the permit input falls and comes back while the clock stands: the pins need no clock to go
        # off, and a clock to come on
        script.permit(False)
        script.permit(True)
        script.wait(1)
        stopped = script.run()
        assert [seen.gates for seen in stopped] == [0, 0, 0]
        assert stopped[1].clock == stopped[0].clock
        # by the time they might, the guard has tripped
        script.wait(1000)
        seen = script.run()[-1]
        assert (seen.gates, seen.changes) == (0, 0)
        with pytest.raises(RefusedError, match="not"):
            board.request(Type.STEP, b"")
        assert board.step(0).faults & 1
        # no decision for longer than the watchdog allows
        board.write("system.control", 0)
        board.run_up()
        script.wait(0x10000)
        assert script.run()[-1].gates == 0


def test_a_step_on_the_other_link_or_from_another_position_is_refused() -> None:
    with Script(generics("mptc")) as script:
        board = Hostile(script, True)
        decision = board.run_up()
        on = script_gates(board)
        with pytest.raises(RefusedError) as refused:
            board.step(decision.position & 7 ^ 1)
        assert refused.value.outcome is Outcome.POSITION
        acted = board.count - 1  # what is refused does not count
        # the last measurement, and the oldest that is told from a new one
        for old in (acted, acted - 63):
            board.count = old - 1
            with pytest.raises(RefusedError) as refused:
                board.step(decision.position & 7)
            assert refused.value.outcome is Outcome.REPEATED
        board.count = acted
        decision = board.step(decision.position & 7)
        assert script_gates(board) == on
        script.steps_over_spi(False)
        script.wait(10)
        script.run()
        with pytest.raises(RefusedError) as refused:
            board.step(decision.position & 7)
        assert refused.value.outcome is Outcome.LINK
        assert script_gates(board) == on


def test_the_link_without_control_reads_and_disables_and_does_nothing_else() -> None:
    with Script(generics("mptc")) as script:
        board = Hostile(script, True)
        decision = board.run_up()
        on = script_gates(board)
        assert on != 0
        other = Hostile(script, False)
        script.steps_over_spi(True)
        script.wait(40)
        script.run()
        names = [name for name in registers_of("mptc") if name != "system.control"]
        before = {n: board.read(n) for n in names if n.startswith(("guard.", "measurements."))}
        for name in names:
            with pytest.raises(RefusedError) as refused:
                other.write(name, 0xFFFF)
            assert refused.value.outcome is Outcome.LINK, name
            # the watchdog wants decisions
            assert board.step(decision.position & 7).position == decision.position
        before |= {name: board.read(name) for name in before if name.startswith("measurements.")}
        for word in (1, 2, 0x100):
            with pytest.raises(RefusedError) as refused:
                other.write("system.control", word)
            assert refused.value.outcome is Outcome.LINK
        with pytest.raises(RefusedError) as refused:
            other.step(decision.position & 7)
        assert refused.value.outcome is Outcome.LINK
        assert {name: board.read(name) for name in before} == before
        assert script_gates(board) == on
        # what the link in control has sent is stale here, with either switch
        for control in (True, False):
            script.steps_over_spi(control)
            script.wait(40)
            script.run()
            own, other.number = other.number, board.number - 1
            with pytest.raises(RefusedError) as refused:
                other.step(decision.position & 7)
            assert refused.value.outcome is Outcome.STALE
            other.number = own
        script.steps_over_spi(True)
        script.wait(40)
        # it reads, and it disables
        assert other.read("system.status") == board.read("system.status")
        assert other.read("system.gates") == on
        assert script_gates(board) == on
        other.write("system.control", 0)
        assert script_gates(board) == 0
        assert not board.read("system.control")


def test_settings_are_locked_and_addresses_between_two_words_are_none() -> None:
    with Script(generics("mptc")) as script:
        board = Hostile(script, True)
        board.run_up()
        on = script_gates(board)
        for name in (name for name in registers_of("mptc") if name.startswith("guard.")):
            before = board.read(name)
            assert board.response(name, before ^ 0x7FF) == 2, name
            assert board.read(name) == before
        control = registers_of("mptc")["system.control"][0]
        for address in range(control + 1, control + 4):
            reply = board.request(Type.WRITE, struct.pack("<HI", address, 0))
            assert reply[2] == 2
            reply = board.request(Type.READ, struct.pack("<H", address))
            assert reply[2:] == bytes([2, 0, 0, 0, 0])
        assert script_gates(board) == on
        # disabled, they are set; enabled again only with a commit
        board.write("system.control", 0)
        board.write("guard.watchdog", 0xFFF0)
        assert board.response("system.control", 1) == 2
        board.write("system.command", 1)
        board.write("system.control", 1)


def test_decisions_on_any_measurement_are_the_models_with_their_flags() -> None:
    """MPFC at its corners: values that saturate, a torque that cannot be reached; then MPDCC."""
    rng = np.random.default_rng(5)
    drive = load_drive(MPTC).with_control(method="MPFC")
    register = mptc_registers(drive).array()
    seen: set[int] = set()
    with Script(generics("mptc")) as script:
        board = Hostile(script, True)
        load(board, values(drive, clock=CLOCK))
        u = board.step(0).position & 7
        for row in mptc_rows.any_measurements(rng, 60):
            got = decided(board, row, u)
            after, saturated, clamped = mptc_bit_true.decide_words(register, row, u)
            flags = saturated << Flag.SATURATED | clamped << Flag.CLAMPED
            switches = int(mptc_rows.SWITCHES[after])
            assert (got.position, got.flags, got.length) == (after | switches << 3, flags, 0), row
            u = int(after)
            seen.add(got.flags)
    assert len(seen) == 4
    shipped = load_drive(MPDCC)
    array = VARIANTS["fast"].registers(shipped).array()
    seen = set()
    with Script(generics("mpdcc")) as script:
        board = Hostile(script, True)
        load(board, values(shipped, clock=CLOCK))
        position = 0
        for n, row in enumerate(states.words(60, rng)):
            measured = np.array(MEASUREMENTS) if n % 10 == 9 else row
            s = np.array([position >> 3 * x & 7 for x in range(3)])
            got = decided(board, measured, position)
            *after, held, deadlock, length, saturated = bit_true_fast.decide_words(
                array, measured, s
            )[:7]
            flags = held << Flag.HELD | deadlock << Flag.DEADLOCK | saturated << Flag.SATURATED
            position = p.packed_positions([int(x) for x in after])
            assert (got.position, got.flags, got.length) == (position, flags, length), measured
            seen.add(got.flags)
    assert any(flags >> Flag.SATURATED & 1 for flags in seen)
    assert any(flags >> Flag.DEADLOCK & 1 for flags in seen)
    assert any(not flags for flags in seen)


def test_a_commit_that_waits_for_a_long_decision_stops_no_disable() -> None:
    """SESE without a budget, one start and commit, then everything that a host may want at once."""
    drive = load_drive(MPDCC).with_control(switching_horizon="SESE")
    rng = random.Random(7)
    known = registers_of("mpdcc")
    with Script(generics("mpdcc")) as script:
        board = Hostile(script, True)
        found = values(drive, clock=CLOCK)
        found.words |= {"guard.decision_limit": 0xFFFF, "guard.watchdog": 0xFFFF}
        load(board, found)
        board.write("system.control", 0)
        # a state whose decision takes long
        slowest: tuple[int, list[int]] = (0, [])
        for _ in range(60):
            words = [w + rng.randrange(-1500, 1500) for w in MEASUREMENTS]
            words[8] = MEASUREMENTS[8]
            board.number += 1
            payload = p.step_payload(words, p.packed_positions((6, 2, 1)), 1)
            script.spi(Frame(Type.STEP, board.number, payload).wire())
            script.wait(2500)
            script.spi(bytes(40))
            (stuffed,) = Splitter().feed(script.run()[-1].spi)
            frame = p.judge(stuffed)[1]
            assert frame is not None
            decision = Decision.unpack(frame.payload)
            slowest = max(slowest, (decision.cycles, words))
        cycles, words = slowest
        assert cycles > 900

        def measured() -> None:
            """All measurements to their registers: they count for one start."""
            ports = [n for n in known if n.startswith("measurements.")]
            for port, word in zip(ports, [*words, 6, 2, 1], strict=True):
                board.request(Type.WRITE, struct.pack("<HI", known[port][0], word & 0xFFFF))

        measured()
        board.write("system.faults", 0x7FFF)
        board.write("system.control", 0b0011)  # enable, measurements from the registers
        for _ in range(2):  # those were measured before
            board.write("system.command", 0b0010)
            script.wait(5000)
        assert script_gates(board) == 0
        measured()
        board.write("system.command", 0b0010)
        script.wait(5000)
        assert script_gates(board) != 0
        measured()
        # start and commit; a shadow, which has to be refused; is it waiting? a disable; the faults
        shadow, _ = known["parameters.horizon"]
        requests = [
            (Type.WRITE, struct.pack("<HI", known["system.command"][0], 0b0011)),
            (Type.WRITE, struct.pack("<HI", shadow, 5)),
            (Type.WRITE, struct.pack("<HI", known["system.control"][0], 0)),
            (Type.READ, struct.pack("<H", known["system.status"][0])),
        ]
        line = b""
        for kind, payload in requests:
            board.number += 1
            line += Frame(kind, board.number, payload).wire() + bytes(21)
        script.spi(line + bytes(30))
        seen = script.run()[-1]
        frames = [p.judge(stuffed)[1] for stuffed in Splitter().feed(seen.spi)]
        answers = [frame.payload[2:] for frame in frames if frame is not None]
        assert [answer[0] for answer in answers] == [0, 2, 0, 0]
        busy, pending, running = (answers[3][1] >> bit & 1 for bit in (0, 1, 2))
        assert (busy, pending, running) == (1, 1, 0)
        assert seen.gates == 0
        # nothing is left of it
        script.wait(5000)
        assert not board.read("system.status") & 0b11
        assert board.request(Type.WRITE, struct.pack("<HI", shadow, 5))[2] == 0


def test_an_spi_exchange_of_a_step_fits_well_into_a_control_period() -> None:
    """At SCK of 25 MHz, clock of the core 25 MHz: the request, a slowest decision, the reply."""
    with Script(generics("mpdcc")) as script:
        script.steps_over_spi(True)
        script.wait(40)
        number = p.first_sequence(1) + 1
        request = Frame(Type.STEP, number, p.step_payload([0] * 13, 0, 1)).wire()
        script.run()
        script.spi(request + bytes(60))
        (seen,) = script.run()
        stuffed = next(iter(Splitter().feed(seen.spi)))
        end = seen.spi.index(stuffed) + len(stuffed) + 1
        frame = p.judge(stuffed)[1]
        assert frame is not None
        decision = Decision.unpack(frame.payload)
        # a byte is 8 clocks
        slowest = worst_cycles("fast", 1)
        clocks = 8 * end + slowest - decision.cycles
        assert clocks / CLOCK < 33e-6
