"""Single upsets of flip-flops, on the netlists that are mapped for ECP5.

Sweep: guards of ANPC and two-level legs, every flip-flop; some flip-flops of each part of a board.
Stimulus: a drive that runs and trips; each flip-flop turned over in two clocks of it, those of the
board, whose host is on SPI, in one.
Checks: no flip gives a shorted pattern for longer than one clock; every outcome is met; a campaign
that was stopped goes on, one with another netlist begins again.
Faults: an interlock that does not look behind the output registers, times without their parity, a
guard that does not trip, or stops at once.
Does not prove: flips in other clocks, or of two flip-flops; `make upsets` has more.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from scripts.commands.upsets import cli
from scripts.hdl.sources import RTL
from scripts.shared import tables
from scripts.shared.tools import ROOT, ToolError
from scripts.studies import upsets
from tb.helpers.faults import altered

CASES = {name: case for name, case in upsets.CASES.items() if case.entity == "gate_guard"}


def _found(name: str, rtl: Path = RTL) -> tuple[upsets.Netlist, list[upsets.Outcome]]:
    with upsets.built(CASES[name], rtl) as (netlist, flips):
        found = flips(2, 1, 0, len(netlist.names) - 1)
        assert len(found) == 2 * len(netlist.names)
        parts = set(CASES[name].parts)
        if not CASES[name].generics.get("SECOND_SUPERVISOR"):
            parts.remove("second supervisor")
        assert {upsets.part_of(CASES[name], one) for one in netlist.names} == parts
    return netlist, found


@pytest.mark.parametrize("name", CASES)
def test_no_upset_shorts_for_longer_than_a_clock(name: str) -> None:
    netlist, found = _found(name)
    assert max(one.shorted for one in found) == 1  # an output register, for one clock
    kinds = Counter(one.kind for one in found)
    assert kinds["shorted"] == 0
    # the supervisor's times have a parity bit: a stop is as long as it should be
    unsafe = {netlist.names[one.flip_flop] for one in found if one.kind in upsets.UNSAFE}
    assert not {one for one in unsafe if "dead" in one}, unsafe
    if CASES[name].generics.get("SECOND_SUPERVISOR"):
        # nothing that one of the two does alone goes unnoticed
        parts = {k: upsets.part_of(CASES[name], one) for k, one in enumerate(netlist.names)}
        seen = Counter((parts[one.flip_flop], one.kind) for one in found)
        assert seen["second supervisor", "fault"] >= 20
        for part in ("supervisor", "second supervisor"):
            assert not any(seen[part, kind] for kind in ("wrong", *upsets.UNSAFE)), seen
    for kind in ("nothing", "fault", "wrong"):
        assert kinds[kind] >= 10, kind


def test_no_upset_of_a_board_shorts_for_longer_than_a_clock() -> None:
    case = upsets.CASES["board, two_level"]
    with upsets.built(case) as (netlist, flips):
        parts = [upsets.part_of(case, name) for name in netlist.names]
        assert set(parts) == set(case.parts)
        firsts = map(parts.index, case.parts)
        found = [one for first in firsts for one in flips(1, 1, first, first + 49)]
    assert max(one.shorted for one in found) <= 1
    assert len({one.kind for one in found} - set(upsets.UNSAFE)) == 3


def test_supervisors_that_are_not_compared_are_found(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "gate_guard", "upset or disagree;", "upset;")
    name = "gate guard, two_level, second supervisor"
    netlist, found = _found(name, rtl)
    names = (netlist.names[one.flip_flop] for one in found if one.kind == "wrong")
    assert "supervisor" in {upsets.part_of(CASES[name], one) for one in names}


def test_an_interlock_before_the_output_registers_alone_is_found(tmp_path: Path) -> None:
    rtl = altered(
        tmp_path, "gate_leg", "upset   <= is_forbidden(TABLED_LEG, driven);", "upset   <= '0';"
    )
    _, found = _found("gate guard, two_level", rtl)
    assert sum(one.kind == "shorted" for one in found) >= 3


def test_times_without_parity_are_found(tmp_path: Path) -> None:
    rtl = altered(tmp_path, "gate_supervisor", "parity xor parity_of(dead & rest);", "'0';")
    netlist, found = _found("gate guard, anpc5l", rtl)
    assert any("dead" in netlist.names[one.flip_flop] for one in found if one.kind == "late")


@pytest.mark.parametrize(
    ("name", "entity", "old", "new"),
    [
        ("gate guard, two_level", "trip_comparator", "valid_2 and beyond;", "'0';"),
        ("gate guard, anpc5l", "gate_leg", "lowered <= stop_of(TABLED_LEG, driven);",
         "lowered <= (others => '0');"),
    ],
    ids=["no trip", "a stop at once"],
)  # fmt: skip
def test_a_guard_that_does_not_stop_as_it_should_is_no_base(
    tmp_path: Path, name: str, entity: str, old: str, new: str
) -> None:
    rtl = altered(tmp_path, entity, old, new)
    with pytest.raises(ToolError, match="the run without an upset has problems"):
        _found(name, rtl)


def test_the_page_has_what_is_kept() -> None:
    stored = upsets.read()
    assert set(stored["cases"]) == set(upsets.CASES)
    assert upsets.problems(stored) == []
    page = upsets.PAGE.read_text(encoding="utf-8")
    assert tables.inside(page, *upsets.MARKS).strip() == upsets.markdown(stored)
    safety = " ".join((ROOT / "docs" / "safety.md").read_text(encoding="utf-8").split())
    (all5, n5), (all2, n2), (both, n), (whole, few) = (
        (f"{case['done'] * case['times']:,}", len(case["unsafe"]))
        for case in stored["cases"].values()
    )
    assert f"Of {all5} flips (ANPC) {n5:,} were unsafe, of {all2} (two-level) {n2}," in safety
    assert f"with a second supervisor {n} of {both}, of a whole board {few} of {whole} " in safety


@pytest.fixture
def netlists(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """A guard of 80 flip-flops whose flips end in faults; the key "stop" makes one fail."""
    told = {"text": "one netlist", "stop": ""}

    @contextmanager
    def _built(_: upsets.Case) -> Iterator[tuple[upsets.Netlist, upsets.Flips]]:
        def _flips(times: int, _seed: int, first: int, last: int) -> list[upsets.Outcome]:
            if str(first) == told["stop"]:
                raise ToolError("stopped")
            each = [k for k in range(first, last + 1) for _ in range(times)]
            return [upsets.Outcome(k, 7, told.get("kind", "fault"), 1) for k in each]

        names = tuple(f"i_supervisor.word[{k}]" for k in range(80))
        yield upsets.Netlist(told["text"], (), names, (0,) * 80), _flips

    monkeypatch.setattr(upsets, "built", _built)
    return told


def test_a_campaign_goes_on_where_it_was_stopped(
    tmp_path: Path, netlists: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "upsets.json"
    arguments = ["gate guard, anpc5l", "--times", "12", "--out", str(path)]
    netlists["stop"] = "64"
    assert cli.main(arguments) == 1
    kept = upsets.read(path)["cases"]["gate guard, anpc5l"]
    assert kept["done"] == 64
    assert kept["counts"]["supervisor"] == {"fault": 64 * 12}
    netlists["stop"] = "0"  # what is done is not done again
    assert cli.main(arguments) == 0
    kept = upsets.read(path)["cases"]["gate guard, anpc5l"]
    assert kept["done"] == 80
    assert kept["counts"]["supervisor"] == {"fault": 80 * 12}
    assert "| gate guard, anpc5l | all | 80 | 12 | 0 | 960 | 0 | 0 |" in capsys.readouterr().out
    netlists["text"] = "another netlist"
    assert cli.main(arguments) == 1  # begins at the first one, which fails
    assert upsets.read(path)["cases"]["gate guard, anpc5l"]["done"] == 0
    assert cli.main([*arguments, "--seed", "2"]) == 1
    assert "with --anew" in capsys.readouterr().err


def test_a_shorted_pattern_fails_the_campaign(
    tmp_path: Path, netlists: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    netlists["kind"] = "shorted"
    arguments = ["gate guard, anpc5l", "--times", "1", "--out", str(tmp_path / "upsets.json")]
    assert cli.main(arguments) == 1
    said = capsys.readouterr()
    assert "i_supervisor.word[0] in clock 7: a shorted pattern" in said.err
    assert "a shorted pattern for more than one clock: 80" in said.out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--times", "0"], "at least 1"), (["guard"], "no netlist 'guard'; there are")],
)
def test_wrong_arguments_are_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        cli.main(arguments)
    assert said in capsys.readouterr().err
