"""The bitstream flow with tools that are scripts of a few lines.

Sweep: one and two seeds at a time; each clock, each seed, each step of the comparison gone wrong.
Stimulus: reports and configurations as nextpnr writes them, with chosen figures.
Checks: the worst of all seeds is what is told; a seed that misses a clock, another set of clocks,
words that differ when unpacked are errors and leave no bitstream; the second build is from a
conversion of its own; a recorder, in a folder of its own; the page's table.
Does not prove: anything about the real tools, which `make bitstream` runs.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scripts.commands.bitstream import cli
from scripts.hdl import conversion as netlist
from scripts.hdl.boards import BOARDS, Board
from scripts.measure import bitstream
from scripts.shared import tools
from scripts.shared.tools import ToolError

BOARD = BOARDS["ulx3s-85f"]
SEEDS = 5

NEXTPNR = """
import json, pathlib, sys
def value(name):
    return sys.argv[sys.argv.index(name) + 1]
given = json.loads(pathlib.Path({given!r}).read_text())
clock, sck = given["reached"][value("--seed")]
names = given["clocks"]
reached = (clock, sck, 300)
fmax = {{n: dict(achieved=v, constraint=25) for n, v in zip(names, reached, strict=True)}}
used = dict(TRELLIS_COMB=dict(used=123, available=83640), DP16KD=dict(used=0, available=208))
pathlib.Path(value("--report")).write_text(json.dumps(dict(fmax=fmax, utilization=used)))
text = ".tile R1C1:PLC2" + chr(10) + "word: SLICEA.K0.INIT 0101" + chr(10)
pathlib.Path(value("--textcfg")).write_text(text + "seed " + value("--seed") + chr(10))
"""

PACK = """
import shutil, sys
shutil.copy(sys.argv[sys.argv.index("--input") + 1], sys.argv[sys.argv.index("--bit") + 1])
"""

UNPACK = """
import pathlib, sys
text = pathlib.Path(sys.argv[1]).read_text()
pathlib.Path(sys.argv[2]).write_text(text.replace({lost!r}, "0000") if {lost!r} else text)
"""


@pytest.fixture
def flow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """`build` with chosen figures; what it returns."""

    def run(
        reached: dict[int, tuple[float, float]] | None = None,
        clocks: tuple[str, str, str] = ("$glbnet$core_clock", "spi_sck", "oscillator"),
        lost: str = "",
        jobs: int = 1,
    ) -> dict[str, Any]:
        given = tmp_path / "given.json"
        figures = {n: (60.0 + n, 150.0 - n) for n in range(1, SEEDS + 1)} | (reached or {})
        given.write_text(json.dumps({"reached": figures, "clocks": clocks}))
        for variable, text in {
            "NEXTPNR": NEXTPNR.format(given=str(given)),
            "YOWASP-ECPPACK": PACK,
            "YOWASP-ECPUNPACK": UNPACK.format(lost=lost),
        }.items():
            script = tmp_path / f"{variable.lower()}.py"
            script.write_text(text)
            monkeypatch.setenv(variable, f"{sys.executable} {script}")
        monkeypatch.setattr(tools, "version", lambda name: f"{name} 1")

        def synthesise(*arguments: object) -> Path:
            out = Path(str(arguments[3])) / "mapped.json"
            out.write_text("{}")
            return out

        monkeypatch.setattr(bitstream, "synthesise", synthesise)
        # nothing kept of the figures before
        for path in tmp_path.glob("out/mapped-*"):
            path.unlink()
        found = bitstream.build(BOARD, "mptc", 1, SEEDS, tmp_path / "out", lambda _: None, jobs)
        found["reproduced"] = True
        return found

    return run


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_worst_of_all_seeds_is_told_and_the_first_is_packed(
    flow: Any, tmp_path: Path, jobs: int
) -> None:
    found = flow({4: (31.25, 99.5)}, jobs=jobs)
    assert (found["fmax_worst_mhz"], found["sck_worst_mhz"], found["seeds"]) == (31.25, 99.5, 5)
    assert found["used"] == {"TRELLIS_COMB": (123, 83640)}
    assert found["words_compared"] == 1
    bit = tmp_path / "out" / "ulx3s-85f-mptc.bit"
    assert "seed 1\n" in bit.read_text()
    assert found["sha256"] == bitstream.sha256(bit)


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("seed", [1, 3, 5])
@pytest.mark.parametrize(("reached", "name"), [((24.9, 100.0), "clock"), ((60.0, 24.9), "spi_sck")])
def test_a_seed_that_misses_a_clock_is_an_error_and_leaves_no_bitstream(
    flow: Any, tmp_path: Path, jobs: int, seed: int, reached: tuple[float, float], name: str
) -> None:
    flow()
    bit = tmp_path / "out" / "ulx3s-85f-mptc.bit"
    assert bit.exists()
    with pytest.raises(ToolError, match=f"seed {seed}: {name} reaches 24.9 MHz of 25"):
        flow({seed: reached}, jobs=jobs)
    assert not bit.exists()


def test_a_clock_that_is_missing_in_the_report_is_an_error(flow: Any) -> None:
    with pytest.raises(ToolError, match="clocks"):
        flow(clocks=("clock", "another", "oscillator"))


def test_a_recorder_has_a_folder_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    built = []

    def build(
        board: Board, controller: str, explorers: int, seeds: int, folder: Path, *_: Any
    ) -> dict:
        folder.mkdir(exist_ok=True)
        built.append(board.generics(controller, explorers).get("RECORDER_ROWS"))
        return {}

    monkeypatch.setattr(bitstream, "FOLDER", tmp_path)
    monkeypatch.setattr(bitstream, "build", build)
    monkeypatch.setattr(bitstream, "table", lambda _: "")
    for more in ([], ["--recorder", "256"]):
        cli.main(["--board", BOARD.name, *more])
    assert built == [None, 256]
    assert [
        str(path.parent.relative_to(tmp_path)) for path in sorted(tmp_path.rglob("*.json"))
    ] == [
        "recorder",
        ".",
    ]
    with pytest.raises(SystemExit, match="2"):
        cli.main(["--board", BOARD.name, "--recorder", "100"])
    assert "1024" in capsys.readouterr().err


def test_a_word_that_differs_when_unpacked_is_an_error(flow: Any) -> None:
    with pytest.raises(ToolError, match="2 of 1 words differ when unpacked"):
        flow(lost="0101")


def test_a_word_of_several_tiles_is_found_at_one_of_them() -> None:
    placed = bitstream._words(
        ".tile R1:LUT\nword: K0.INIT 0110\nword: K1.INIT 1111\n"
        ".tile_group R2:EBR0 R2:EBR1\nword: EBR0.WID 1010\n.bram_init 3\n001 002\n003\n"
    )
    assert len(placed) == 3

    def unpacked(number: str, tile: str = "R2:EBR1", contents: str = "001 002\n003") -> int:
        return bitstream.differing(
            placed,
            bitstream._words(
                f".tile R1:LUT\nword: K0.INIT 0110\n.tile {tile}\nword: EBR0.WID {number}\n"
                f".bram_init 3\n{contents}\n"
            ),
        )

    assert unpacked("1010") == unpacked("1011") == unpacked("1010", "R2:EBR0") == 0
    assert unpacked("0010") == unpacked("1010", "R3:EBR0") == 2
    # at both tiles
    assert unpacked("1011\n.tile R2:EBR0\nword: EBR0.WID 1110") == 0
    assert unpacked("1011\n.tile R2:EBR0\nword: EBR0.WID 0110") == 2
    assert unpacked("1010", contents="001 002\n004") == 2
    assert bitstream.differing(placed, {}) == 3


def test_a_number_of_ones_in_its_tile_is_known_by_its_contents() -> None:
    placed = bitstream._words(
        ".tile_group R2:EBR0 R2:EBR1\nword: EBR0.WID 1100\n.bram_init 3\n001 002\n"
    )
    assert len(placed) == 2
    shown = bitstream._words(".bram_init 3\n001 002\n")
    assert bitstream.differing(placed, shown) == 0
    assert bitstream.differing(placed, bitstream._words(".bram_init 3\n001 004\n")) == 2
    assert bitstream.differing(placed, bitstream._words(".bram_init 4\n001 002\n")) == 3
    alone = bitstream._words(".tile R2:EBR0\nword: EBR0.WID 1100\n.bram_init 3\n001 002\n")
    assert bitstream.differing(alone, shown) == 1


def test_a_word_of_zeros_is_left_out_for_a_pll_alone() -> None:
    pll = bitstream._words(".tile_group R4:PLL0_UL R5:PLL1_UL\nword: KVCO 000\nword: DIV 0110\n")
    found = bitstream._words(".tile R5:PLL1_UL\nword: DIV 0110\n")
    assert bitstream.differing(pll, found) == 0
    assert bitstream.differing(pll, {}) == 1
    wrong = bitstream._words(".tile R5:PLL1_UL\nword: DIV 0010\n")
    assert bitstream.differing(pll, wrong) == 2
    table = bitstream._words(".tile R1:LUT\nword: K0.INIT 0000\n")
    assert bitstream.differing(table, {}) == 1


def test_the_second_build_converts_the_vhdl_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def convert(
        top: str, generics: object, out: Path, files: list[Path], std: str
    ) -> tuple[Path, None]:
        asked.append(out)
        out.write_text("module board_top; endmodule\n")
        return out, None

    def kept(*_: object, **__: object) -> Path:
        raise AssertionError("a kept conversion was used")

    monkeypatch.setattr(netlist, "convert", convert)
    monkeypatch.setattr(netlist, "cached", kept)
    monkeypatch.setattr(bitstream, "map_netlist", lambda *a, **_: a[3].write_text("{}"))
    mapped = bitstream.synthesise(BOARD, "mptc", 1, tmp_path, anew=True)
    assert mapped.parent == tmp_path
    assert [path.parent for path in asked] == [tmp_path]


def test_a_converter_is_chosen_in_one_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = []

    def kept(top: str, generics: object, rtl: Path) -> Path:
        packages.append((rtl / "converter" / "converter_leg.vhd").read_text())
        out = tmp_path / "kept.v"
        out.write_text(f"module board_top; endmodule // {len(packages)}\n")
        return out

    monkeypatch.setattr(netlist, "cached", kept)
    monkeypatch.setattr(bitstream, "map_netlist", lambda *a, **_: a[3].write_text("{}"))
    chosen = [BOARD, replace(BOARD, converter="npc3l")]
    stems = [bitstream.synthesise(one, "mpdcc", 1, tmp_path).stem for one in chosen]
    assert [stem.rsplit("-", 1)[0] for stem in stems] == [
        "ulx3s-85f-mpdcc", "ulx3s-85f-mpdcc-npc3l",
    ]  # fmt: skip
    named = [f"-- Switch positions of a leg of the converter {n}" for n in ("anpc5l", "npc3l")]
    assert [text.splitlines()[0].split(" (")[0] for text in packages] == named
    for controller in ("mptc", "kbest"):
        with pytest.raises(ToolError, match=f"{controller} has one converter"):
            bitstream.build(chosen[1], controller, 1, 1, tmp_path, lambda _: None)


def test_the_page_has_a_row_for_every_bitstream(flow: Any) -> None:
    found = flow() | {"commit": "0123456789abcdef", "modified": False, "tools": {"ghdl": "GHDL 1"}}
    before = "a\n<!-- bitstreams: begin (written by scripts/measure/bitstream.py --page) -->\nold\n"
    kept = "| ulx3s-12f, MPTC |" + " not built again |" * 10
    before += f"| ulx3s-85f, MPTC | of before |\n{kept}\n"
    text = bitstream.page(before + "<!-- bitstreams: end -->\nb\n", [found])
    rows = [line for line in text.splitlines() if line.startswith("| ulx3s-")]
    assert len(rows) == 2
    assert rows[1] == kept
    assert "| 123 of 83640 | 0 | 0 | 0 | 61.0 MHz of 100 | 145.0 MHz of 25 | 5 |" in rows[0]
    assert "`, twice | `0123456789ab` |" in rows[0]
    assert "old" not in text
    both = bitstream.page(text, [found, found | {"controller": "family"}])
    names = [line.split(" | ")[0] for line in both.splitlines() if line.startswith("| ulx3s-")]
    assert names == ["| ulx3s-85f, MPTC", "| ulx3s-85f, MPTC family", "| ulx3s-12f, MPTC"]
    beside = bitstream.page(text, [found, found | {"recorder": 256}])
    assert "| ulx3s-85f, MPTC, recorder of 256 steps | 123 of 83640 |" in beside
    other = bitstream.page(text, [found | {"controller": "mpdcc", "converter": "npc3l"}])
    assert "| ulx3s-85f, MPDCC, `npc3l` | 123 of 83640 |" in other
    with pytest.raises(ToolError, match="markers"):
        bitstream.page("nothing", [found])
