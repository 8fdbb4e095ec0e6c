"""The engine "rtl" of the library: the cores as native libraries, beside the bit-true model.

Sweep: both shipped MPDCC drives with SE, SESE, delay compensation and the leakage's estimate; every
other converter with SESE; the paper's explorer; K-best; every method of two-level drives.
Stimulus: closed loops; random states far outside their formats; resets and states taken back in
the middle of a decision.
Checks: every field of every decision is the model's; cycles are those that the cores promise; two
instances do not disturb each other; what is missing is named in one line; systems whose idle clocks
are skipped have every output at its clock, and in the end the state, of those that compute them.
Timing: a build takes 20 to 60 s for a core, once for a source.
Does not prove: that the Verilog is the VHDL (tb/tools/test_netlist.py does).
"""

from __future__ import annotations

import argparse
import random
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from directmpc import (
    Drive,
    ModelController,
    MpdccState,
    MptcDrive,
    MptcState,
    NativeError,
    RtlController,
    decide,
    load_drive,
    simulate,
)
from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.host.registers import packed, registers_of, values
from directmpc.mpdcc import tables
from directmpc.mpdcc.variants import library_of
from directmpc.mptc.drive import SEQUENCE_METHODS
from directmpc.native import Design, library
from scripts.commands.native import cli
from scripts.hdl import mptc_replay, native, replay
from scripts.hdl.clocks import worst_clocks
from scripts.studies import mptc_loop, rtl_loop

STEPS = 300


@pytest.fixture(scope="module")
def design() -> Callable[[str], str]:
    """Makes sure that the Verilog of a design is there."""

    def write(name: str) -> str:
        native.write([name])
        return name

    return write


def same(drive: Drive | MptcDrive, **options) -> np.ndarray:
    """Cycles of a loop whose decisions are the model's in every field."""
    model = simulate(drive, "model", steps=STEPS, **options).table()
    result = simulate(drive, "rtl", steps=STEPS, **options)
    found = result.table()
    assert model.keys() == found.keys()
    assert len(model["time"]) == STEPS
    for name, column in model.items():
        assert np.array_equal(found[name], column), name
    assert result.controller == "rtl"
    return result.decisions.cycles


MPDCC_SETTINGS = {
    "SE": {"switching_horizon": "SE"},
    "SESE": {"switching_horizon": "SESE", "budget": 200},
    "compensation": {"delay_compensation": True},
    "leakage": {"leakage_estimate": True, "delay_compensation": True},
}


@pytest.mark.parametrize("name", ["anpc5l_6kv", "anpc5l_3kv3"])
@pytest.mark.parametrize("settings", MPDCC_SETTINGS)
def test_a_loop_of_mpdcc_is_the_models(name: str, settings: str, design) -> None:
    design("mpdcc_core")
    cycles = same(load_drive(name).with_control(**MPDCC_SETTINGS[settings]), speed=0.6)
    assert len(cycles) == STEPS
    assert 0 < cycles.min() < cycles.max()
    if settings == "SE":
        assert cycles.max() <= worst_clocks(2, "fast")


@pytest.mark.parametrize("name", sorted(tables.NAMES[1:], key=lambda name: name != "npc3l"))
def test_a_loop_of_another_converter_is_the_models(name: str, design) -> None:
    design(library_of("fast", name))
    drive = load_drive("npc3l_3kv3").changed(
        inverter={"topology": name}, control=MPDCC_SETTINGS["SESE"]
    )
    assert len(set(same(drive, speed=0.6).tolist())) > 2


def test_a_loop_of_the_papers_explorer_is_the_models(design) -> None:
    design("mpdcc_core_paper")
    same(load_drive("anpc5l_6kv").with_papers_rules(), variant="paper")


@pytest.mark.parametrize("settings", [{}, {"delay_compensation": True, "capacitor_filter": 4}])
def test_a_loop_of_kbest_is_the_models(settings: dict[str, object], design) -> None:
    design("kbest_system")
    cycles = same(load_drive("anpc5l_6kv_kbest").with_control(**settings), speed=0.6)
    assert 0 < cycles.min() < cycles.max() <= 1100


@pytest.mark.parametrize("method", ["MPTC", "MPFC", *SEQUENCE_METHODS])
def test_a_loop_of_two_levels_is_the_models(method: str, design) -> None:
    design("mptc_family_core" if method in SEQUENCE_METHODS else "mptc_core")
    cycles = same(load_drive("induction_2kw2").with_control(method=method))
    assert len(set(cycles.tolist())) == 1
    assert cycles[0] == {"MPTC": 39, "MPFC": 78}.get(method, cycles[0])


def wild_mpdcc(rng: random.Random) -> MpdccState:
    """A state that may lie far outside every format."""

    def any_(scale: float) -> float:
        return (30.0 if rng.random() < 0.04 else 1.0) * rng.uniform(-scale, scale)

    current = complex(any_(1), any_(1))
    return MpdccState(
        current=current, flux=complex(any_(1), any_(1)), v_n=any_(0.1),
        v_ph=(0.5 + any_(0.1), 0.5, 0.5), current_ref=current + complex(any_(0.2), any_(0.2)),
        omega_s=any_(1), omega_r=any_(1), applied=tuple(rng.randrange(8) for _ in "abc"),
        vdc=2 + abs(any_(0.2)),
    )  # fmt: skip


def wild_mptc(rng: random.Random) -> MptcState:
    """The same in SI units."""

    def any_(scale: float) -> float:
        return (30.0 if rng.random() < 0.04 else 1.0) * rng.uniform(-scale, scale)

    return MptcState(
        current=complex(any_(15), any_(15)), flux=complex(any_(1), any_(1)), omega_r=any_(300),
        torque_ref=any_(20), psi_ref=abs(any_(1)), applied=rng.randrange(8),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "core", "wild"),
    [
        ("anpc5l_6kv", "mpdcc_core", wild_mpdcc),
        ("anpc5l_6kv_kbest", "kbest_system", wild_mpdcc),
        ("induction_2kw2", "mptc_core", wild_mptc),
    ],
)
def test_wild_states_are_decided_as_by_the_model(name: str, core: str, wild, design) -> None:
    design(core)
    drive, rng = load_drive(name), random.Random(7)
    rtl, model = RtlController(drive), ModelController(drive)
    saturated = 0
    for k in range(500):
        state = wild(rng)
        found, wanted = rtl.decide(state), model.decide(state)
        assert found == wanted, (k, state)
        saturated += found.saturated
    assert 20 < saturated < 480


def test_two_instances_share_nothing(design) -> None:
    drives = [load_drive("induction_2kw2").with_control(method=m) for m in ("MPTC", "MPFC")]
    design("mptc_core")
    together = [RtlController(drive) for drive in drives]
    rng = random.Random(3)
    for _ in range(50):
        state = wild_mptc(rng)
        for drive, one in zip(drives, together, strict=True):
            assert one.decide(state) == decide(drive, state, "model")


def test_a_reset_and_a_state_taken_back_in_the_middle_of_a_decision(design) -> None:
    one = Design(design("mptc_core"))
    one.give({"is_alpha": 900, "psis_alpha": 12_000, "v_dc": 32_768, "psi_ref": 12_000})
    wanted = one.decide()
    one.put("start", 1)
    one.clocks(1)
    one.put("start", 0)
    one.clocks(10)
    assert one.get("busy") == 1
    state, edges = one.save(), one.edges
    one.reset()
    assert one.get("busy") == 0
    assert one.decide() == wanted
    one.restore(state)
    assert (one.get("busy"), one.edges) == (1, edges)
    left = 0
    while not one.get("valid"):
        one.clocks(1)
        left += 1
    assert 11 + left == wanted[1]
    assert {n: one.get(n) for n, p in one.ports.items() if not p.is_input} == wanted[0]
    with pytest.raises(NativeError, match="no state of this design"):
        one.restore(state[:-1])
    with pytest.raises(NativeError, match="no state of this design"):
        one.restore(b"x" * len(state))


@pytest.mark.parametrize(
    ("name", "method", "variant"),
    [
        ("anpc5l_6kv", "SE", "fast"),
        ("anpc5l_6kv", "SESE", "fast"),
        ("anpc5l_6kv", "SE", "paper"),
        ("npc3l_3kv3", "SE", "fast"),
        *(("induction_2kw2", method, "") for method in ("MPTC", "MPFC", "SVM")),
    ],
)
def test_run_and_replay_are_ghdls(
    name: str, method: str, variant: str, tmp_path: Path, monkeypatch
) -> None:
    """The commands' loop and their rows, by the library and by GHDL: decisions and clocks."""
    drive = load_drive(name)
    key = "switching_horizon" if variant else "method"
    drive = drive.with_control(**{key: method}, **({"capacitor_filter": 0} if variant else {}))
    if variant == "paper":
        drive = drive.with_control(deadlock_rule="largest", outside_rule="dead")
    seen = []
    for native_ in (True, False):
        monkeypatch.setattr(native, "LONG", 1 if native_ else 10**9)
        monkeypatch.setattr(native.conversion, "is_cached", lambda *_, **__: False)
        if variant:
            run = rtl_loop.simulate(drive, 1.0, 30, 2, variant)
            rows, decisions = run.result.seen, run.result.decisions
            again = replay._decide_mpdcc(drive, rows, "rtl", 2, variant)
        else:
            run = mptc_loop.simulate(drive, mptc_loop.Point.of(drive), 30)
            rows, decisions = run.trace, run.decisions
            again = mptc_replay.decide(drive, rows, "rtl")
        assert run.differing == 0
        for one in (decisions, again):
            seen.append({n: v for n, v in vars(one).items() if isinstance(v, np.ndarray)})
    assert seen[0]["cycles"].min() > 0
    for one in seen[1:]:
        assert one.keys() == seen[0].keys()
        for column, values_ in seen[0].items():
            assert np.array_equal(one[column], values_), column


def test_the_library_is_taken_where_it_is_quicker(monkeypatch, design) -> None:
    design("mptc_core")
    library.build("mptc_core")
    assert native.prefer("mptc_core", 1)  # it is there
    monkeypatch.setattr(native.library, "kept", lambda _: (Path("/none"), []))
    assert not native.prefer("mptc_core", 1)
    monkeypatch.undo()
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert not native.prefer("mptc_core", 10**6)


def loaded(drive: AnyDrive, name: str) -> Design:
    """A system with a drive's registers, gates enabled, its clock 50 MHz."""
    one = Design(name)
    registers = registers_of(drive.controller)
    status, fields = registers["system.status"]
    while one.read(status) >> fields["commit_pending"][0] & 1:  # behind the reset
        one.clocks(10)
    for register, address, word in values(drive, clock=50e6).writes():
        assert one.write(address, word), register
    one.clocks(300)
    one.put("enable", 1)
    control, fields = registers["system.control"]
    assert one.write(control, packed("system.control", fields, {"enable": 1}))
    return one


SYSTEMS = {
    "mpdcc_system": ("anpc5l_6kv", 0.8),
    "kbest_system": ("anpc5l_6kv_kbest", 0.55),
    "mptc_system": ("induction_2kw2", 0.8),
}
"""System -> a drive, and the least share of clocks that is not computed."""


class Recorder(ModelController):
    """The model, which keeps the states that it is asked about."""

    def __init__(self, drive: AnyDrive) -> None:
        super().__init__(drive)
        self.states: list[MpdccState | MptcState] = []

    def decide(self, state):
        """Decide as the model does."""
        self.states.append(state)
        return super().decide(state)


def inputs_of(drive: AnyDrive, steps: int) -> list[dict[str, int]]:
    """Inputs of a system at each step of a closed loop."""
    recorder, encode = Recorder(drive), kind_of(drive).encoder(drive)
    simulate(drive, recorder, steps=steps)
    return [words | applied for words, applied, _ in map(encode, recorder.states)]


@pytest.mark.parametrize("name", SYSTEMS)
def test_clocks_that_are_not_computed_change_nothing(name: str, design) -> None:
    """Every change of every output at its clock, and the whole state at the end."""
    drive, share = load_drive(SYSTEMS[name][0]), SYSTEMS[name][1]
    design(name)
    quick, slow = loaded(drive, name), loaded(drive, name)
    assert quick.save() == slow.save()
    outputs = [n for n, port in quick.ports.items() if not port.is_input]
    rng, changes = random.Random(5), 0
    for number, words in enumerate(inputs_of(drive, 40)):
        for one in (quick, slow):
            for port, word in words.items():
                one.put(port, word)
            one.put("external_trip", int(number == 33))
            one.put("start", 1)
            one.clocks(1)
            one.put("start", 0)
        left = 2499 if rng.random() < 0.8 else rng.randrange(1, 4000)
        while left:
            watched = rng.choice(["gates", "valid", "busy", "running", "faults"])
            passed = quick.until(watched, left)
            left -= passed
            before = slow.get(watched)
            for _ in range(passed - 1):
                slow.clocks(1)
                assert slow.get(watched) == before
            slow.clocks(1)
            changes += slow.get(watched) != before
            assert {n: quick.get(n) for n in outputs} == {n: slow.get(n) for n in outputs}
        assert quick.save() == slow.save(), number
    assert changes > 20
    assert slow.skipped == 0
    assert quick.skipped > share * quick.edges


def test_the_command_takes_some_designs_or_none(capsys) -> None:
    parser = argparse.ArgumentParser()
    cli.arguments(parser)
    assert parser.parse_args([]).designs == []
    assert parser.parse_args(["mptc_core", "--rates"]).designs == ["mptc_core"]
    with pytest.raises(SystemExit):
        parser.parse_args(["no_core"])
    assert "got 'no_core'; it must be of mpdcc_core, " in capsys.readouterr().err


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch, design) -> None:
    with pytest.raises(NativeError, match="'make native' writes it"):
        library.verilog_of("no_such_core")
    with pytest.raises(NativeError, match="no answer on the register bus"):
        Design(design("mptc_core")).write(0, 0)
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(NativeError, match="there is no C\\+\\+ compiler"):
        library.compiler()
    library.verilator.cache_clear()
    monkeypatch.setenv("VERILATOR", str(tmp_path / "none"))
    with pytest.raises(NativeError, match="there is no command"):
        library.verilator()
    library.verilator.cache_clear()


def test_a_fault_in_the_verilog_is_seen(tmp_path: Path, monkeypatch, design) -> None:
    """A choice that prefers the wrong vector: the loop no longer is the model's."""
    design("mptc_core")
    text = library.verilog_of("mptc_core").read_text(encoding="utf-8")
    at = text.index("assign u_next =")
    end = text.index(";", at)
    wrong = f"{text[:end]} ^ 3'b001{text[end:]}"
    (tmp_path / "mptc_core.v").write_text(wrong, encoding="utf-8")
    monkeypatch.setattr(library, "VERILOG", tmp_path)
    library.load.cache_clear()
    try:
        with pytest.raises(AssertionError, match="u"):
            same(load_drive("induction_2kw2"))
    finally:
        library.load.cache_clear()


def test_it_is_fast_enough(design) -> None:
    """At least 3,000 decisions a second of one core are wanted; a loaded machine has a tenth."""
    design("mpdcc_core")
    drive = load_drive("anpc5l_6kv")
    core = RtlController(drive)
    simulate(drive, core, steps=20)
    began = time.process_time()
    simulate(drive, core, steps=1000)
    rate = 1000 / (time.process_time() - began)
    assert rate > 1000, f"{rate:.0f} decisions a second"
