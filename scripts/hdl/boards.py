"""Boards: parts, clocks and pins, and the generics that build ``board_top`` for one.

Pins are those of public board files, named per board. `generate.boards` makes the constraint files
from this table; tests compare its port names with ``board_top`` and look for pins used twice.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from directmpc.mpdcc import tables
from scripts.shared.tools import ROOT, Generics

CONSTRAINTS = ROOT / "constraints"
SCK_MHZ = 25
"""Fastest SPI clock that is constrained."""

#: What `board_top` can be built as, and how it is called in tables.
BUILDS = {"mpdcc": "MPDCC", "kbest": "K-best", "mptc": "MPTC", "family": "MPTC family"}

#: Steps that a recorder can keep; 0: none is built.
RECORDER_ROWS = (0, *(2**n for n in range(3, 11)))

#: Ports of board_top that are vectors, and their widths.
VECTORS = {"gates": 24, "leds": 4, "held_high": 3}


@dataclass(frozen=True)
class Board:
    """A board."""

    #: As `make bitstream` takes it; in words.
    name: str
    title: str
    part: str  #: Device, package and speed grade.
    #: Oscillator, and by how much board_top divides it for the core.
    clock_mhz: int
    divide: int
    baud: int  #: UART rate it is built for.
    controllers: tuple[str, ...]  #: Build options it has room for.
    pins: dict[str, str]  #: Port (bit) to package pin.
    source: str  #: Where the pins were taken from.
    family: str  #: "ecp5", "xc7", "xc6s" or "xc3s".
    notes: tuple[str, ...] = ()  #: Lines for the constraint file's head.
    #: I/O standard of the clock where it is another than the rest's.
    clock_standard: str = "LVCMOS33"
    tail: tuple[str, ...] = ()
    #: What its PLL makes of the oscillator for the core, by controller; empty without one.
    pll_mhz: dict[str, int] = field(default_factory=dict)
    pulls: dict[str, str] = field(default_factory=dict)  #: Port to "UP" or "DOWN".
    #: Pins through which another part of the board can have the FPGA reconfigured, and what stands
    #: there; `held_high` is on each of them.
    reconfigured_by: dict[str, str] = field(default_factory=dict)
    #: Options of MPDCC that it has no room for, generics of board_top that are false there.
    left_out: tuple[str, ...] = ()
    recorder: int = 0  #: Steps that its recorder keeps; 0: it has none.
    converter: str = tables.DEFAULT  #: What MPDCC is built for.

    def core_mhz(self, controller: str) -> float:
        """Clock of the core."""
        return self.pll_mhz.get(controller) or self.clock_mhz / self.divide

    def generics(self, controller: str, explorers: int = 1) -> Generics:
        """Generics of board_top."""
        found: Generics = {
            "CONTROLLER": {"mpdcc": 1, "kbest": 3, "mptc": 2, "family": 2}[controller],
            "CLOCK_HZ": int(self.core_mhz(controller) * 1e6),
            "DIVIDE": self.divide,
            "BAUD": self.baud,
        }
        if self.pll_mhz:
            found["PLL"] = True
        if self.recorder:
            found["RECORDER_ROWS"] = self.recorder
        if controller == "mpdcc":
            found["EXPLORERS"] = explorers
            found |= dict.fromkeys(self.left_out, False)
        if controller == "family":
            found |= {"FAMILY": True, "SENSORLESS": True}
        return found

    @property
    def vendor_files(self) -> tuple[Path, ...]:
        """Verilog with the vendor's primitives that its top needs."""
        return (ROOT / "rtl" / "boards" / f"{self.family}_clock.v",) if self.pll_mhz else ()

    @property
    def constraint_file(self) -> Path:
        """Where its constraints are."""
        suffix = {"ecp5": "lpf", "xc7": "xdc"}.get(self.family, "ucf")
        stem = self.name.rsplit("-", 1)[0] if self.family == "ecp5" else self.name
        return CONSTRAINTS / f"{stem.replace('-', '_')}.{suffix}"


def _bits(name: str, pins: str) -> dict[str, str]:
    return {f"{name}[{index}]": pin for index, pin in enumerate(pins.split())}


_ULX3S_PINS = {
    "clock": "G2",
    "uart_tx": "L4",
    "uart_rx": "M1",
    "steps_over_spi": "E8",  # DIP switch 1
    "spi_sck": "B11",  # J1, GP0
    "spi_cs_n": "C11",  # GN0
    "spi_mosi": "A10",  # GP1
    "spi_miso": "A11",  # GN1
    "permit": "A9",  # GP2
    "driver_fault_n": "B10",  # GN2
    "driver_ready": "B9",  # GP3
    **_bits("leds", "B2 C2 C1 D2"),
    # J2: GP14, GN14, GP15, ... GN25
    **_bits(
        "gates",
        "U18 U17 N17 P16 N16 M17 L16 L17 H18 H17 F17 G18 D18 E17 C18 D17 B15 C15 B17 C17 C16 D16 "
        "D14 E14",
    ),
    **_bits("held_high", "L2 F1 M4"),
}
_PULLS = {"uart_rx": "UP", "spi_cs_n": "UP", "permit": "DOWN", "held_high": "UP"}
_PULLS |= {"spi_sck": "DOWN", "spi_mosi": "DOWN", "steps_over_spi": "DOWN"}
_PULLS |= {"driver_fault_n": "DOWN", "driver_ready": "DOWN"}


def _ulx3s(size: str, controllers: tuple[str, ...]) -> Board:
    return Board(
        name=f"ulx3s-{size}",
        title=f"ULX3S, LFE5U-{size.upper()}",
        part=f"LFE5U-{size.upper()}-6BG381C",
        clock_mhz=25,
        divide=1,
        pll_mhz={"mpdcc": 100, "kbest": 75, "mptc": 100, "family": 75},
        baud=3_000_000,
        controllers=controllers,
        pins=_ULX3S_PINS,
        source="github.com/emard/ulx3s, doc/constraints/ulx3s_v20.lpf and prototype/ulx3s_v316.lpf",
        family="ecp5",
        notes=(
            "SPI, permit, drivers' FAULT and READY on J1 (GP0, GN0 to GN2, GP3), gates on J2",
            "(GP14, GN14 to GP25, GN25), steps over SPI with DIP switch 1.",
            "High: wifi_gpio0 of boards up to v3.0 (L2) and from v3.1 on (F1), user_programn (M4).",
        ),
        pulls=_PULLS,
        reconfigured_by={
            "L2": "wifi_gpio0 up to v3.0: low for seconds lets the ESP32 take over JTAG",
            "F1": "wifi_gpio0 from v3.1 on; the ESP32's enable before",
            "M4": "user_programn: low has the flash read anew",
        },
    )


BOARDS = {
    board.name: board
    for board in (
        _ulx3s("85f", ("mpdcc", "kbest", "mptc", "family")),
        _ulx3s("25f", ("mpdcc", "kbest", "mptc", "family")),
        _ulx3s("12f", ("mpdcc", "kbest", "mptc", "family")),
        Board(
            name="arty-s7-50",
            title="Digilent Arty S7-50, XC7S50",
            part="xc7s50csga324-1",
            clock_mhz=100,
            divide=4,
            baud=3_000_000,
            controllers=("mpdcc", "mptc"),
            pins={
                "clock": "R2",
                "uart_tx": "R12",
                "uart_rx": "V12",
                "steps_over_spi": "H14",
                "spi_sck": "G16",
                "spi_cs_n": "H16",
                "spi_mosi": "H17",
                "spi_miso": "K14",
                "permit": "L13",
                "driver_fault_n": "T14",
                "driver_ready": "R16",
                **_bits("leds", "E18 F13 E13 H15"),
                **_bits(
                    "gates",
                    "L17 L18 M14 N14 M16 M17 M18 N18 P17 P18 R18 T18 P14 P15 N15 P16 "
                    "U15 V16 U17 U18 U16 P13 R13 V14",
                ),
                **_bits("held_high", "N13 L16 R14"),
            },
            source="github.com/Digilent/digilent-xdc, Arty-S7-50-Master.xdc",
            family="xc7",
            notes=(
                "SPI on ck_io10 to 13, permit on ck_io0, drivers' FAULT and READY on ck_io4 and 5,",
                "gates of phases a, b, c on Pmods JA, JB, JC, steps over SPI with SW0. Nothing on",
                "the board reconfigures it: held_high is on ck_io1 to 3, which are free.",
            ),
            clock_standard="SSTL135",
            tail=(
                "set_property CFGBVS VCCO [current_design]",
                "set_property CONFIG_VOLTAGE 3.3 [current_design]",
                "set_property INTERNAL_VREF 0.675 [get_iobanks 34]",
            ),
            pulls=_PULLS,
        ),
        Board(
            name="pipistrello",
            title="Saanlima Pipistrello, XC6SLX45",
            part="xc6slx45-csg324-3",
            clock_mhz=50,
            divide=2,
            baud=3_000_000,
            controllers=("mpdcc", "mptc"),
            pins={
                "clock": "H17",
                "uart_tx": "A10",
                "uart_rx": "A11",
                "steps_over_spi": "G14",
                "spi_sck": "F17",
                "spi_cs_n": "F16",
                "spi_mosi": "E16",
                "spi_miso": "G16",
                "permit": "F15",
                "driver_fault_n": "J13",
                "driver_ready": "G13",
                **_bits("leds", "V16 U16 A16 A15"),
                **_bits(
                    "gates",
                    "U18 T17 P17 P16 N16 N17 M16 L15 L17 K15 K17 J16 H15 H18 F18 D18 "
                    "C18 E18 G18 H16 J18 K18 K16 L18",
                ),
                **_bits("held_high", "F14 H14 H13"),
            },
            source="github.com/litex-hub/litex-boards, platforms/saanlima_pipistrello.py, and "
            "github.com/Saanlima/Pipistrello",
            family="xc6s",
            notes=(
                "Gates on wings A0 to A15 and B0 to B7, SPI on C0 to C3, permit on C4, steps over",
                "SPI on C5, drivers' FAULT and READY on C9, C10. Nothing on the board reconfigures",
                "it: held_high is on C6 to C8, which are free.",
            ),
            pulls=_PULLS,
        ),
        Board(
            name="spartan3-starter",
            title="Spartan-3 Starter Kit, XC3S1000",
            part="xc3s1000-ft256-4",
            clock_mhz=50,
            divide=2,
            baud=115_200,
            controllers=("mpdcc", "mptc"),
            left_out=("SECOND_LEVEL", "CAPACITOR_FILTER", "LEAKAGE_ESTIMATE"),
            pins={
                "clock": "T9",
                "uart_tx": "R13",
                "uart_rx": "T13",
                "steps_over_spi": "F12",
                "spi_sck": "A10",
                "spi_cs_n": "B11",
                "spi_mosi": "B12",
                "spi_miso": "A12",
                "permit": "B13",
                "driver_fault_n": "A13",
                "driver_ready": "B14",
                **_bits("leds", "K12 P14 L12 N14"),
                **_bits(
                    "gates",
                    "E6 D5 C5 D6 C6 E7 C7 D7 C8 D8 C9 D10 A3 B4 A4 B5 A5 B6 B7 A7 B8 A8 A9 B10",
                ),
                **_bits("held_high", "P13 N12 P12"),
            },
            source="github.com/AakaFosfor/S3StarterKit, S3StarterKit.ucf (board: UG130)",
            family="xc3s",
            notes=(
                "Gates on A2, pins 4 to 27, SPI on 28 to 31, permit on 32, drivers' FAULT and",
                "READY on 33 and 34, steps over SPI: SW0.",
                "Its UART is an RS-232 transceiver: 115200 baud.",
                "Nothing on the board reconfigures it: held_high is on the LEDs LD4 to LD6.",
            ),
            pulls=_PULLS,
        ),
    )
}
