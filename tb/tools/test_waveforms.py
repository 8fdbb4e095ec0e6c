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
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import registers as mpdcc_registers
from directmpc.mpdcc.formats import MEASUREMENTS as MPDCC_MEASUREMENTS
from directmpc.mptc import bit_true
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
from tb.helpers.faults import altered

SVG = "{http://www.w3.org/2000/svg}"


@cache
def recorded(entity: str) -> recording.Recorded:
    scene = scenes.SCENES[entity]()
    return recording.record(entity, scene.clocks, scene.generics)


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
    found = recording.read_vcd(VCD, "recorded", 4)
    assert found.values["word"] == [3, 10, 10, 1]
    assert found.bits == {"clk": 1, "word": 4}
    assert recording.read_vcd(VCD.replace("b0011", "b0x11"), "recorded", 1).values["word"] == [None]


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
    assert entity_pages.waveform(entity) == {f"{entity}-waves.svg": picture}, "another run"
    found, scene = recorded(entity), scenes.SCENES[entity]()
    drawn: dict[str, list[str]] = {name: [] for name in scene.shown}
    text = sources.entities()[entity].read_text(encoding="utf-8")
    comments = {port.name: port.comment for port in entity_pages.ports(text, entity)}
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


def test_the_page_shows_the_waveform() -> None:
    held = budgets.load()
    for entity in ("mac_block", "host_link"):
        page = entity_pages.page(entity, held, site.ENTITIES / f"{entity}.md")
        assert (f"]({entity}-waves.svg)" in page) == (entity in scenes.SCENES)
    assert entity_pages.waveform("host_link") == {}
    assert set(scenes.SCENES) <= set(entity_pages.PUBLIC)
