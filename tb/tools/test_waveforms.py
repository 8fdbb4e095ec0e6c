"""Waveforms of the entities' pages: what is drawn was recorded, and is what the models say.

Stimulus: the runs that the pages show; made-up recordings; faults in the VHDL.
Checks: outputs of every clock against the twins, or against the arithmetic of the header; clocks
from start to the result against the file of budgets; every drawn value against the recording; what
is left out has no change; formats as the ports' comments have them; the same bytes twice.
Does not prove: what the pictures look like.
"""

from __future__ import annotations

import re
from dataclasses import fields
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from directmpc.api.drive_file import load_mptc_drive
from directmpc.host.gate_guard import GateGuard, Inputs
from directmpc.mpdcc import capacitor_observer, leakage, observer
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import registers as mpdcc_registers
from directmpc.mpdcc.formats import MEASUREMENTS as MPDCC_MEASUREMENTS
from directmpc.mptc import bit_true, bit_true_sequences, drive_twin, speed_observer
from directmpc.mptc import vector_sequencer as twin
from directmpc.mptc.coefficients import registers as mptc_registers
from directmpc.mptc.formats import MEASUREMENTS as MPTC_MEASUREMENTS
from scripts.hdl import recording, sources, states
from scripts.hdl.clocks import clocks_of
from scripts.hdl.recording import RecordingError
from scripts.measure import budgets
from scripts.publish import entity_pages, scenes, site, waveforms
from scripts.publish.waveforms import Row
from scripts.shared import tools
from scripts.shared.tools import ROOT
from scripts.studies.sensorless import sensorless_drive
from tb.helpers.faults import altered

SVG = "{http://www.w3.org/2000/svg}"


@cache
def recorded(entity: str) -> recording.Recorded:
    return scenes.record(entity)[1]


def signed(value: int | None, bits: int) -> int:
    assert value is not None
    return value - (1 << bits) if value >> bits - 1 else value


def starts(values: recording.Values) -> list[int]:
    return [clock for clock, value in enumerate(values["start"]) if value]


# --- what is recorded -----------------------------------------------------------------------------


def test_inputs_are_those_that_were_given() -> None:
    for entity in ("binary_search", "mac_block", "gate_guard"):
        found, now = recorded(entity), {}
        for clock, inputs in enumerate(scenes.SCENES[entity]().clocks):
            now |= inputs
            for name, value in now.items():
                bits = found.bits[name]
                assert found.values[name][clock] == value & ((1 << bits) - 1), (name, clock)


def test_binary_search() -> None:
    found = recorded("binary_search").values
    clocks = [clocks_of("binary_search", name) for name in ("latency", "exit_1", "exit_2")]
    wanted = [(0, 730 // 100), (0, 50), (1, None)]
    for start, count, (below, length) in zip(starts(found), clocks, wanted, strict=True):
        assert found["done"][start + 1 : start + count + 1] == [0] * (count - 1) + [1]
        assert found["below"][start + count] == below
        assert length in (None, found["length"][start + count])


def test_mac_block() -> None:
    found = recorded("mac_block")
    latency = clocks_of("mac_block", "latency")
    words, total = (3, -5, 7, 100), 0
    for clock in range(len(found.values["enable"]) - latency):
        if found.values["enable"][clock]:
            now = {name: values[clock] or 0 for name, values in found.values.items()}
            product = words[now["a_select"]] * words[now["b_select"]] << 3 * now["alignment"]
            total = product + (total if now["accumulate"] else signed(now["seed"], 43))
        if clock:
            assert signed(found.values["accumulator"][clock + latency], 43) == total
    assert total == 7 * 3 - 8


def test_vector_sequencer() -> None:
    found = recorded("vector_sequencer").values
    latency = clocks_of("vector_sequencer", "latency")
    first, second = starts(found)
    rate = found["rate"][second] or 0
    for start, end in ((first, second), (second, len(found["u"]) - latency)):
        sequence = tuple(found[name][start] or 0 for name in ("u1", "u2", "u3", "t1", "t2"))
        played = twin.play(sequence, bool(found["segmented"][start]), rate, end - start)
        assert found["u"][start + latency : end + latency] == played.tolist()
    assert found["playing"][first + latency - 1 : first + latency + 1] == [0, 1]


def test_gate_guard() -> None:
    found = recorded("gate_guard").values
    guard = GateGuard(False, 6)
    for clock in range(len(found["rst"]) - 1):
        given = {f.name: found[f.name][clock] for f in fields(Inputs)}
        # a decision takes the positions of the clock before
        for name in ("position_a", "position_b", "position_c"):
            given[name] = found[name][max(clock - 1, 0)]
        guard.clock(Inputs(**given))
        if clock:
            wanted = guard.gates, guard.running, guard.resting, guard.fault_bits
            names = ("gates", "running", "resting", "faults")
            assert tuple(found[name][clock + 1] for name in names) == wanted, clock
    assert 1 in found["running"]
    assert found["faults"][-1] == 1
    assert found["gates"][-1] == 0
    # the header's clocks: two to a movement of gates, one to all gates off
    decided, trip = found["decided"].index(1), found["external_trip"].index(1)
    assert found["gates"][decided : decided + 3] == [0, 0, found["gates"][decided + 2]]
    assert found["gates"][decided + 2] != 0
    assert found["gates"][trip] != 0
    assert found["gates"][trip + 1] == 0


def test_mptc_core() -> None:
    found = recorded("mptc_core")
    register = mptc_registers(load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml"))
    for start, method in zip(starts(found.values), ("mptc", "mpfc"), strict=True):
        given = [
            value if name in ("v_dc", "psi_ref") else signed(value, found.bits[name])
            for name, value in ((name, found.values[name][start]) for name in MPTC_MEASUREMENTS)
        ]
        words = register.array()
        words[-1] = method == "mpfc"
        u, saturated, _ = bit_true.decide_words(words, np.array(given), found.values["u"][start])
        end = start + clocks_of("mptc_core", method)
        assert 1 not in found.values["valid"][start:end]
        names = ("valid", "u_next", "saturated")
        assert [found.values[name][end] for name in names] == [1, u, saturated]


def test_mpdcc_core() -> None:
    found = recorded("mpdcc_core")
    register = mpdcc_registers(states.shipped(states.SHIPPED[0]), "fast").array()
    unsigned = ("v_ph_a", "v_ph_b", "v_ph_c", "v_dc")
    kinds = []
    for start in starts(found.values):
        given = [
            value if name in unsigned else signed(value, found.bits[name])
            for name, value in ((name, found.values[name][start]) for name in MPDCC_MEASUREMENTS)
        ]
        before = [found.values[f"s_prev_{x}"][start] for x in "abc"]
        answer = fast.decide_words(register, np.array(given), np.array(before))
        end = found.values["valid"].index(1, start)
        names = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
        assert [found.values[name][end] for name in names] == [int(v) for v in answer[:7]]
        kinds.append(answer[3])
        if answer[3]:
            assert end - start == clocks_of("mpdcc_core", "hold", "fast")
    assert kinds == [1, 0]


def seen(found: recording.Recorded, clock: int, names: tuple[str, ...], *plain: str) -> np.ndarray:
    """Signals of a clock, signed but for those named."""
    return np.array(
        [
            found.values[name][clock]
            if name in plain
            else signed(found.values[name][clock], found.bits[name])
            for name in names
        ],
        dtype=np.int64,
    )


VOLTAGES = ("v_ph_a", "v_ph_b", "v_ph_c", "v_dc")
SEQUENCE = ("u1", "u2", "u3", "t1", "t2")


def test_state_observer() -> None:
    found = recorded("state_observer")
    drive = states.shipped(states.SHIPPED[0]).with_control(capacitor_filter=4)
    voltages = np.zeros(capacitor_observer.STATE_WORDS, dtype=np.int64)
    flux, ratio = np.zeros(observer.STATE_WORDS, dtype=np.int64), leakage.first()
    f = capacitor_observer.array(capacitor_observer.coefficients(drive))
    o = observer.array(observer.coefficients(drive)[0])
    c = leakage.array(leakage.coefficients(drive)[0])
    names = ("is_alpha", "is_beta", "v_n", *VOLTAGES, "omega_r")
    used = ("used_n", "used_a", "used_b", "used_c")
    later = clocks_of("state_observer", "filtered") - clocks_of("state_observer", "flux")
    *begun, scaling = starts(found.values)
    assert len(begun) == 3
    assert found.values["scale"][scaling] == 1
    for start in begun:
        s = np.array([found.values[f"s_{x}"][start] for x in "abc"], dtype=np.int64)
        m = seen(found, start, names, *VOLTAGES)
        wanted = capacitor_observer.step_words(f, voltages, m[:6], s, 0)
        end = start + clocks_of("state_observer", "filters")
        assert found.values["filters_valid"][end] == 1
        got = seen(found, end, (*used, "filters_saturated"), *used[1:], "filters_saturated")
        assert got.tolist() == [int(v) for v in wanted]
        m[2:6] = wanted[:4]
        estimate = observer.step_words(o, flux, m, s)
        end = start + clocks_of("state_observer", "filtered")
        assert found.values["valid"][start + 1 : end + 1] == [0] * (end - start - 1) + [1]
        got = seen(found, end, ("flux_alpha", "flux_beta", "saturated"), "saturated")
        assert got.tolist() == [int(v) for v in estimate]
        known = seen(found, start, ("is_alpha", "is_beta", "psir_alpha", "psir_beta", "omega_r"))
        v = observer.voltages(m, s)[:2]
        theta = leakage.step_voltages(c, ratio, known, v, 0)
        end = start + clocks_of("state_observer", "leakage") + later
        assert found.values["leakage_valid"][end] == 1
        got = seen(found, end, ("theta", "leakage_saturated"), "theta", "leakage_saturated")
        assert got.tolist() == [int(word) for word in theta]
    scale = found.values["scale"].index(1)
    idle = scale + clocks_of("state_observer", "scaling") + 1
    assert found.values["busy"][scale + 1 : idle + 1] == [1] * (idle - scale - 1) + [0]


def test_mptc_speed_observer() -> None:
    found = recorded("mptc_speed_observer")
    drive = sensorless_drive(load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml"))
    coefficient = speed_observer.array(speed_observer.coefficients(drive))
    state = np.zeros(5, dtype=np.int64)
    for start in starts(found.values):
        m = seen(found, start, ("is_alpha", "is_beta", "v_dc"), "v_dc")
        applied = np.array([found.values[name][start] for name in SEQUENCE], dtype=np.int64)
        speed, *rest = map(int, speed_observer.step_words(coefficient, state, m, applied))
        early = start + clocks_of("mptc_speed_observer", "speed")
        assert found.values["speed_valid"][start : early + 1] == [0] * (early - start) + [1]
        assert signed(found.values["omega_r"][early], 16) == speed
        end = start + clocks_of("mptc_speed_observer", "latency")
        assert found.values["valid"][end] == 1
        got = seen(found, end, ("psis_alpha", "psis_beta", "saturated"), "saturated")
        assert got.tolist() == rest


def test_mptc_drive() -> None:
    found = recorded("mptc_drive")
    drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")
    words = drive_twin.parameters(drive, limit=8.0, flux=0.9)
    state = drive_twin.initial()
    names = ("is_alpha", "is_beta", "omega_r", "v_dc", "torque_ref", "psi_ref")
    for start in starts(found.values):
        m = seen(found, start, names, "v_dc", "psi_ref")
        wanted = drive_twin.step_words(words, state, m)
        end = start + clocks_of("mptc_drive", "mptc")
        assert found.values["valid"][end] == 1
        outputs = ("u_next", "saturated", "clamped", "exciting")
        assert tuple(found.values[name][end] for name in outputs) == tuple(wanted)
        assert seen(found, end, ("psis_alpha", "psis_beta")).tolist() == state[4:6].tolist()


def test_mptc_family_core() -> None:
    found = recorded("mptc_family_core")
    drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml").with_control(method="MPTC1")
    register = mptc_registers(drive).array()
    for start, name in zip(starts(found.values), ("mptc1", "mpc2"), strict=True):
        m = seen(found, start, tuple(MPTC_MEASUREMENTS), "v_dc", "psi_ref")
        applied = np.array([found.values[name][start] for name in SEQUENCE], dtype=np.int64)
        method = found.values["family_method"][start] - 1
        chosen, saturated, _ = bit_true_sequences.decide_words(register, method, 0, m, applied)
        end = start + clocks_of("mptc_family_core", name)
        assert found.values["valid"][start + 1 : end + 1] == [0] * (end - start - 1) + [1]
        assert [found.values[f"next_{name}"][end] for name in SEQUENCE] == [int(v) for v in chosen]
        assert found.values["saturated"][end] == saturated


def test_scheduler_and_explorer_are_those_of_the_core() -> None:
    core, scheduler = recorded("mpdcc_core").values, recorded("mpdcc_scheduler").values
    for name in ("start", "busy", "valid"):
        assert scheduler[name] == core[name]
    explorer = recorded("mpdcc_explorer").values
    begin = scenes.SCENES["mpdcc_explorer"]().first
    asked = explorer["candidate_valid"].index(1, begin)
    probe = clocks_of("mpdcc_explorer", "probe", "fast")
    assert explorer["probe_done"].index(1, begin) == asked + probe
    assert explorer["candidate_valid"] == [(word or 0) & 1 for word in scheduler["candidate_valid"]]
    # the scheduler decides when all explorers rest
    end = scheduler["valid"].index(1, begin)
    assert scheduler["explorer_busy"][end] == 0
    assert 1 in explorer["busy"][begin:end]


@pytest.mark.parametrize(
    ("entity", "outputs"),
    [("mpdcc_system", ("s_a", "s_b", "s_c")), ("mptc_system", ("u_next", "saturated"))],
)
def test_systems(entity: str, outputs: tuple[str, ...]) -> None:
    found, scene = recorded(entity), scenes.SCENES[entity]()
    for start in starts(found.values):
        end = found.values["valid"].index(1, start)
        # the core begins with the clock behind the start
        assert found.values["cycles"][end + 1] == end - start - 1
        got = [found.values[name][end] for name in outputs]
        if entity == "mpdcc_system":
            register = mpdcc_registers(states.shipped(states.SHIPPED[0]), "fast").array()
            m = seen(found, start, tuple(MPDCC_MEASUREMENTS), *VOLTAGES)
            before = [found.values[f"s_prev_{x}"][start] for x in "abc"]
            wanted = fast.decide_words(register, m, np.array(before))[:3]
            if start == starts(found.values)[0]:  # later ones go on from where the gates are
                assert got == [int(v) for v in wanted]
        else:
            drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")
            m = seen(found, start, tuple(MPTC_MEASUREMENTS), "v_dc", "psi_ref")
            u, saturated, _ = bit_true.decide_words(
                mptc_registers(drive).array(), m, found.values["u"][start]
            )
            if start == starts(found.values)[0]:
                assert got == [u, saturated]
    assert found.values["gates"][scene.first] == 0
    assert found.values["gates"][-1] != 0
    assert found.values["faults"][-1] == 0


def test_host_link() -> None:
    found, scene = recorded("host_link").values, scenes.SCENES["host_link"]()
    asked = found["awvalid"].index(1)
    assert asked > scene.first
    assert (found["awaddr"][asked], found["wdata"][asked]) == (0x00C, 1)
    assert 1 not in found["awvalid"][: scene.first]
    answered = found["bvalid"].index(1)
    assert 0 not in found["uart_tx"][:answered]
    assert 0 in found["uart_tx"][answered:], "the reply begins with a delimiter, low for nine bits"


def test_board_top() -> None:
    found, scene = recorded("board_top").values, scenes.SCENES["board_top"]()
    ended = scene.first + 12 * scenes.BIT
    assert 0 not in found["uart_tx"][:ended]
    replies = found["uart_tx"].index(0, ended)
    levels = found["uart_tx"][replies : replies + 10 * scenes.BIT : scenes.BIT]
    assert levels == [0] * 9 + [1], "a delimiter, the byte 0"
    assert set(found["gates"][scene.first :]) == {0}


def test_a_fault_of_the_vhdl_is_recorded(tmp_path: Path) -> None:
    scene = scenes.SCENES["binary_search"]()
    fault = "most and not unsigned(r.step)", "most"
    rtl = altered(tmp_path, "binary_search", *fault)
    found = recording.record("binary_search", scene.clocks, rtl=rtl)
    assert found.values["length"] != recorded("binary_search").values["length"]


def test_what_cannot_be_recorded_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RecordingError, match="binary_search, clock 1: no port z"):
        recording.record("binary_search", [{}, {"z": 1}])
    with pytest.raises(RecordingError, match="mpdcc_explorer: no flat port: limits"):
        recording.record("mpdcc_explorer", [{}])
    with pytest.raises(RecordingError, match=r"binary_search: no instance i_none"):
        recording.record("binary_search", [{}], within=("i_none",))
    monkeypatch.setenv("GHDL", "none-of-this-name")
    with pytest.raises(tools.ToolError, match="there is no command 'none-of-this-name'"):
        recording.record("binary_search", [{}])


VCD = """\
$timescale
  1 fs
$end
$scope module other $end
$var reg 1 ! a $end
$upscope $end
$scope module recorded $end
$var reg 1 " clk $end
$var reg 4 $ word[3:0] $end
$scope module i_unit $end
$var reg 4 % word[3:0] $end
$upscope $end
$upscope $end
$enddefinitions $end
#0
0!
0"
bUUUU $
b1111 %
#5000000
1"
b0011 $
#15000000
1"
b1010 $
#35000000
b0001 $
"""


def test_value_changes_are_read_by_clock() -> None:
    found = recording.read_vcd(VCD, ["recorded"], 4)
    assert found.values["word"] == [3, 10, 10, 1]
    assert found.bits == {"clk": 1, "word": 4}
    assert recording.read_vcd(VCD.replace("b0011", "b0x11"), ["recorded"], 1).values["word"] == [
        None
    ]


# --- what is drawn --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("comment", "bits", "form", "note"),
    [
        ("stator current, signed, 1/16000 pu", 16, "signed", "signed, 1/16000 pu"),
        ("flux reference, unsigned, psi_max/26979", 15, "unsigned", "unsigned, psi_max/26979"),
        ("signed words, word 0 rightmost", 64, "signed", "signed"),
        ("steps", 6, "unsigned", "unsigned, steps"),
        ("first vector, 0 to 7", 3, "unsigned", "unsigned, 0 to 7"),
        ("latched, bits as in gate_tables", 9, "hex", "hex"),
        ("'1': done, unsigned", 1, "bit", ""),
    ],
)
def test_formats_are_those_of_the_comments(comment: str, bits: int, form: str, note: str) -> None:
    assert waveforms.row("x", comment, bits) == Row("x", form, note, bits)


@pytest.mark.parametrize(
    ("form", "value", "said"),
    [("hex", 26, "1a"), ("hex", 1, "01"), ("signed", 127, "127"), ("signed", 255, "-1"),
     ("unsigned", 255, "255"), ("hex", None, "x")],
)  # fmt: skip
def test_values_are_written_in_their_format(form: str, value: int | None, said: str) -> None:
    assert waveforms.shown(Row("x", form, form, 8), value) == said


def test_clocks_without_a_change_are_left_out() -> None:
    quiet = [0, *[1] * (waveforms.QUIET + 2), 0]
    assert waveforms.columns([quiet]) == [(0, 0), (1, 1), (2, 5), (6, 6), (7, 7)]
    short = [0, *[1] * (waveforms.QUIET + 1), 0]
    assert waveforms.columns([short]) == [(k, k) for k in range(7)]
    assert (2, 5) not in waveforms.columns([quiet, [0, 0, 0, 1, 1, 1, 1, 1]])


@pytest.mark.parametrize("entity", ["binary_search", "mac_block", "vector_sequencer", "gate_guard"])
def test_every_value_that_is_drawn_was_recorded(entity: str) -> None:
    (picture,) = entity_pages.waveform(entity).values()
    found, scene = recorded(entity), scenes.SCENES[entity]()
    drawn: dict[str, list[str]] = {name: [] for name in scene.shown}
    text = sources.entities()[entity].read_text(encoding="utf-8")
    comments = {port.name: port.comment for port in entity_pages.ports(text, entity)}
    assert scenes.picture(entity, comments) == picture, "another run"
    for group in ElementTree.fromstring(picture).iter(f"{SVG}g"):
        title = re.fullmatch(
            r"(\w+) = (\S+), clocks (\d+) to (\d+)", group.findtext(f"{SVG}title", "")
        )
        if title:
            path = group.find(f"{SVG}path")
            before = drawn[title[1]][-1:]
            if path is not None and found.bits[title[1]] == 1 and title[2] != "x":
                assert (path.get("d", "").count("V") == 1) == (before in (["0"], ["1"]))
            assert int(title[3]) == len(drawn[title[1]])
            drawn[title[1]] += [title[2]] * (int(title[4]) - int(title[3]) + 1)
    for name, said in drawn.items():
        one = waveforms.row(name, comments[name], found.bits[name])
        assert said == [waveforms.shown(one, value) for value in found.values[name]], name


def test_every_public_entity_has_a_waveform() -> None:
    held = budgets.load()
    assert set(scenes.SCENES) == set(entity_pages.PUBLIC)
    for entity in entity_pages.PUBLIC:
        page = entity_pages.page(entity, held, site.ENTITIES / f"{entity}.md")
        assert f"]({entity}-waves.svg)" in page


def test_clocks_before_the_scene_are_left_out() -> None:
    (picture,) = entity_pages.waveform("host_link").values()
    scene, found = scenes.SCENES["host_link"](), recorded("host_link")
    last = max(int(clock) for clock in re.findall(r"clocks \d+ to (\d+)", picture))
    assert last == len(found.values["clk"]) - scene.first - 1
