"""docs/safety.md agrees with the proofs, the tests and the sources that it names.

Sweep: every row of its tables.
Stimulus: none.
Checks: properties, proofs, test files and their functions exist; each row says what it has; every
property of what protects the gates has a row; each time is that of its clocks; the words that a
number comes from stand in their source and hold it; the time of the clock monitor is that of its
generics; every fault of the guard and every outcome of a frame has a failure mode.
Timing: none.
Faults: a row with a test or a property that does not exist, a wrong verdict, a wrong time.
Does not prove: that a failure mode is missing.
"""

from __future__ import annotations

import ast
import functools
import math
import re
from pathlib import Path

import pytest

from directmpc.host.gate_guard import FAULTS
from directmpc.host.protocol import Outcome
from scripts.hdl.boards import BOARDS
from scripts.measure import budgets, proofs
from scripts.shared.tools import ROOT

PAGE = ROOT / "docs" / "safety.md"
#: Entities that keep the gates safe; all of their properties are promises.
PROTECTION = {
    "axi_lite_master", "decision_sequencer", "frame_receiver", "gate_guard", "mpdcc_system",
    "mptc_system", "read_gate", "safe_torque_off", "write_gate", "write_rules",
}  # fmt: skip
WORDS = {"one": 1, "two": 2, "three": 3, "four": 4, "fourth": 4}
VERDICTS = {
    (True, True): "both",
    (True, False): "proven",
    (False, True): "tested",
    (False, False): "neither",
}


def table(text: str, name: str) -> list[list[str]]:
    """Cells of the rows of a table between its markers, its head left out."""
    found = re.search(rf"<!-- {name}: begin -->\n(.*?)<!-- {name}: end -->", text, re.S)
    assert found, f"the markers of '{name}' are missing"
    return [
        [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for line in found.group(1).splitlines()[2:]
    ]


def ticked(text: str) -> list[str]:
    """What a text has between backticks."""
    return re.findall(r"`([^`]+)`", text)


@functools.cache
def functions(path: Path) -> frozenset[str]:
    """Names of a module's functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return frozenset(node.name for node in tree.body if isinstance(node, ast.FunctionDef))


@functools.cache
def properties() -> dict[str, Path]:
    """What is proven, as `entity.property`, and the file of the proof."""
    return {
        f"{proof.entity}.{one.name}": proof.module
        for proof in proofs.listed()
        for one in proof.properties
    }


@functools.cache
def plain(path: Path) -> str:
    """A file as one line: without marks of VHDL comments, with single blanks."""
    text = re.sub(r"^\s*--", "", path.read_text(encoding="utf-8"), flags=re.M)
    return " ".join(text.split())


def wrong_promises(text: str) -> list[str]:
    """What is wrong about the promises of a page, one line each."""
    wrong, proven = [], set()
    for promise, proof, test, verdict in table(text, "promises"):
        if promise.startswith("**"):
            continue
        for name in ticked(proof):
            proven.add(name)
            if name not in properties() or not properties()[name].is_file():
                wrong.append(f"{promise}: no property {name}")
        for name in ticked(test):
            file, _, function = name.partition("::")
            path = ROOT / file
            known = functions(path) if path.is_file() else ()
            if not function.startswith("test_") or function not in known:
                wrong.append(f"{promise}: no test {name}")
        if verdict != VERDICTS[bool(ticked(proof)), bool(ticked(test))]:
            wrong.append(f"{promise}: is not '{verdict}'")
    for name in properties():
        if name.partition(".")[0] in PROTECTION and name not in proven:
            wrong.append(f"no row has {name}")
    return wrong


def numbers(words: str) -> set[int]:
    """Numbers that words hold: digits, words, ordinals, and the largest value of a register."""
    found = {int(number) for number in re.findall(r"\b\d+\b", words)}
    found |= {2 ** int(bits) - 1 for bits in re.findall(r"\bu(\d+)\b", words)}
    return found | {value for word, value in WORDS.items() if re.search(rf"\b{word}\b", words)}


def wrong_times(text: str) -> list[str]:
    """What is wrong about the response to faults of a page, one line each."""
    wrong = []
    for cause, _, clocks, slow, fast, source, words in table(text, "response"):
        (name,) = ticked(source)
        quoted = re.fullmatch(r'"(.*)"', words)
        path = ROOT / name
        if not (path.is_file() and quoted and " ".join(quoted[1].split()) in plain(path)):
            wrong.append(f"{cause}: {name} does not say {words}")
        if re.fullmatch(r"[\d,]+", clocks):
            count = int(clocks.replace(",", ""))
            if count not in numbers(words):
                wrong.append(f"{cause}: {words} has no {clocks}")
            wanted = [f"{math.ceil(count * 1000 / mhz):,}" for mhz in (25, 75)]
            if [slow, fast] != wanted:
                wrong.append(f"{cause}: {slow}, {fast} ns, expected {', '.join(wanted)}")
    return wrong


def wrong_costs(text: str) -> list[str]:
    """What is wrong about the table of costs of a page, one line each."""
    wrong, held = [], budgets.load().resources
    response = {row[0]: row[2] for row in table(text, "response")}
    trips = [response["a measurement beyond its limit, at the guard"],
             response["`external_trip` of `gate_guard`"]]  # fmt: skip
    for part, *cells in table(text, "cost"):
        (name,) = ticked(part)
        row = held[name]
        wanted = [f"{row[family][figure]:,}" for family, figure in
                  (("ecp5", "lut"), ("ecp5", "ff"), ("xc3s", "lut"))]  # fmt: skip
        if name.startswith("gate_guard"):
            wanted += [cell for clocks in trips for cell in (clocks, f"{int(clocks) * 10}")]
        if cells[: len(wanted)] != wanted:
            wrong.append(f"{part}: {' | '.join(cells)}, expected {' | '.join(wanted)}")
    return wrong


def test_what_protection_costs_is_what_is_held() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert wrong_costs(text) == []
    assert wrong_costs(text.replace("| 4 | 40 | 1 | 10 |", "| 4 | 40 | 2 | 20 |"))
    assert len(table(text, "cost")) > 5


def wrong_diagnosis(text: str) -> list[str]:
    """What is wrong about the table of diagnosis, one line each."""
    wrong = []
    for part, _, found, _ in table(text, "diagnosis"):
        for name in ticked(found):
            file, _, function = name.partition("::")
            path = ROOT / file
            if not path.is_file() or function not in functions(path):
                wrong.append(f"{part}: no test {name}")
        if not ticked(found):
            wrong.append(f"{part}: no test")
    shares = []
    found = (ROOT / "reports" / "upsets.md").read_text(encoding="utf-8")
    for row in re.findall(r"^\| gate guard, [\w-]+ \| all \|(.*)\|$", found, re.M):
        _, _, _, fault, *others = (int(cell.replace(",", "")) for cell in row.split("|"))
        shares.append(f"{fault / (fault + sum(others)):.0%}".replace("%", " %"))
    said = f"{shares[0]} (ANPC) and {shares[1]} (two-level) of the flips"
    if said not in " ".join(text.split()):
        wrong.append(f"the page does not say: {said}")
    return wrong


def test_the_diagnosis_is_that_of_the_tests_and_of_the_upsets() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert wrong_diagnosis(text) == []
    assert wrong_diagnosis(text.replace("(ANPC) and", "(ANPC),"))
    assert wrong_diagnosis(text.replace("injected: `tb/rtl/boards/", "injected: `tb/rtl/"))


def test_every_promise_has_what_it_names() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert wrong_promises(text) == []
    assert len(table(text, "promises")) > 40


def test_every_time_has_its_source() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert wrong_times(text) == []
    assert len(table(text, "response")) > 15
    clocks = {board.core_mhz(build) for board in BOARDS.values() for build in board.controllers}
    assert sorted(clocks) == [25, 75, 100]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("::test_accesses_end`", "::test_accesses`", "no test"),
        ("tb/rtl/links/axi_lite_master/test_", "tb/rtl/links/test_", "no test"),
        ("`gate_guard.dead_time`", "`gate_guard.dead_times`", "no property"),
        ("`gate_guard.dead_time`", "", "no row has gate_guard.dead_time"),
        ("| Measurements are right. | | | neither |", "| Measurements are right. | | | tested |",
         "is not 'tested'"),
        ("| 4 | 160 | 54 |", "| 4 | 160 | 53 |", "expected 160, 54"),
        ("by the fourth edge", "by the third edge", "does not say"),
        ("| 12 | 480 | 160 |", "| 10 | 400 | 134 |", "has no 10"),
        ("| 256 | 10,240 | 3,414 |", "| 256 | 10,240 | 3,413 |", "expected 10,240, 3,414"),
    ],
)  # fmt: skip
def test_a_wrong_row_is_found(old: str, new: str, said: str) -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert old in text
    changed = text.replace(old, new)
    assert any(said in line for line in wrong_promises(changed) + wrong_times(changed))


def test_the_monitor_is_as_fast_as_the_page_says() -> None:
    text = plain(ROOT / "rtl" / "boards" / "board_top.vhd")
    bits, oscillator = (
        int(re.search(rf"constant {name} : positive := ([\d_]+);", text)[1].replace("_", ""))
        for name in ("DIVIDE_BITS", "OSCILLATOR_HZ")
    )
    # the slowest clock of a PLL
    board = BOARDS["ulx3s-85f"]
    clock = min(map(board.core_mhz, board.controllers))
    beat = 2**bits * oscillator // int(clock * 1000)
    share, more = map(int, re.search(r"LONGEST => BEAT \* (\d+) / 100_000 \+ (\d+)", text).groups())
    slowest = oscillator * (200 - share) / 100
    assert "2.42 MHz within 15 %" in text
    assert share == 115
    seconds = (beat * share // 100_000 + more + 4) / slowest
    (row,) = [row for row in table(PAGE.read_text(encoding="utf-8"), "response") if "13" in row[4]]
    assert seconds <= int(row[4].replace(",", "")) * 1e-9 < 1.1 * seconds
    words = plain(ROOT / "rtl" / "guard" / "clock_monitor.vhd")
    assert "alive falls LONGEST + 4 clocks of the oscillator after the last edge" in words


def test_every_fault_and_outcome_has_a_failure() -> None:
    text = PAGE.read_text(encoding="utf-8")
    guard, link = (
        {name for row in table(text, f"{kind} failures") for name in ticked(" ".join(row))}
        for kind in ("guard", "link")
    )
    # external_trip and trips of measurements are named by their ports, not by their bits
    by_port = {"external_trip", "over_current", "link_high", "link_low"}
    assert set(FAULTS) - by_port <= guard
    # what the checks of a whole frame reject is one failure
    one = {"ACCEPTED", "OVERSIZED", "STUFFING", "SHORT", "LENGTH", "CRC", "TYPE"}
    assert {outcome.name for outcome in Outcome} - one <= link
