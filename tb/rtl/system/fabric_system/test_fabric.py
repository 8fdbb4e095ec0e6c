"""The example without a host: a boot ROM sets the system up, converters' words become decisions.

Sweep: none.
Stimulus: a closed loop of the 6 kV drive through converters of 12 bits; ticks before the boot is
over; a ROM with an entry that nobody answers; permit taken away.
Checks: no decision and no gate before the boot is over, and none if it fails; every decision and
flux is the model's on the words of the converters; gates come on, and off without a clock; the
package of the example is what `make registers` writes; FuseSoC builds the example.
Faults: decisions before the boot is over, two phases in each other's place, a wrong gain.
Timing: clocks from tick to the decision, and of the boot.
Does not prove: boot_loader and mpdcc_system themselves, see test_boot_loader and test_system.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import boot, registers
from scripts.generate.fusesoc_cores import RTL
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.hdl.ghdl import CheckError
from scripts.shared.tools import ROOT
from tb.helpers.drives import plain_file
from tb.helpers.simulation import Outcome, run
from tb.tools.test_fusesoc_cores import build

EXAMPLE = ROOT / "examples" / "fabric"
DRIVE = plain_file("anpc5l_6kv")
FILES = ("adc_scaling.vhd", "clarke.vhd", "fabric_system.vhd")
CLOCK = 100e6
BOOT_CLOCKS = 1411
#: Of the example: clocks from tick to start, and the system's explorers.
LATENCY, EXPLORERS = 5, 2
#: From tick to valid, at most: measurements, flux observer, a decision of one level.
CLOCKS = LATENCY + clocks_of("state_observer", "flux") + worst_cycles("fast", EXPLORERS)


def bench(
    folder: Path, *, steps: int = 10, old: str = "", new: str = "", fails: bool = False
) -> Outcome:
    drive = load_drive(DRIVE)
    rom = boot.format_vhdl(drive, registers.values(drive, clock=CLOCK), DRIVE.name)
    if fails:
        assert rom.count('x"0104') == 1
        rom = rom.replace('x"0104', 'x"03FC')
    texts = {"drive_registers.vhd": rom}
    texts |= {name: (EXAMPLE / name).read_text(encoding="utf-8") for name in FILES}
    for name, text in texts.items():
        (folder / name).write_text(text.replace(old, new) if old else text, encoding="utf-8")
    assert not old or sum(text.count(old) for text in texts.values()) == 1
    return run(
        "fabric_system",
        "tb.rtl.system.fabric_system.bench_fabric",
        units=["mpdcc_system", "boot_loader", "gate_release"],
        files=[folder / name for name in texts],
        arguments={"drive": str(DRIVE), "steps": steps, "fails": int(fails)},
        timeout=900,
    )


def test_it_boots_and_decides_as_the_model(tmp_path: Path) -> None:
    found = bench(tmp_path)
    assert found.measured["clocks"] <= CLOCKS
    assert found.measured["boot"] == BOOT_CLOCKS
    text = (EXAMPLE / "fabric_system.vhd").read_text(encoding="utf-8")
    assert re.search(rf"constant LATENCY +: natural +:= {LATENCY};", text)
    page = (ROOT / "docs" / "using-the-core.md").read_text(encoding="utf-8")
    assert f"| in the example, `EXPLORERS => {EXPLORERS}` | clocks |" in page
    assert f"until `booted` | {BOOT_CLOCKS:,} |" in page
    assert f"to `start` | {LATENCY} |" in page
    assert f"of ten decisions of the test | {found.measured['clocks']} |" in page
    assert f"at most | {CLOCKS} |" in page


def test_a_boot_that_fails_leaves_the_gates_off(tmp_path: Path) -> None:
    bench(tmp_path, fails=True)


@pytest.mark.parametrize(
    ("old", "new", "check"),
    [
        ("start <= ticks(LATENCY) and done;", "start <= ticks(LATENCY);", "early"),
        (
            "      v_ph_b         => scaled(4),",
            "      v_ph_b         => scaled(3),",
            "decision|flux",
        ),
        ("to_signed(18919, 16)", "to_signed(16384, 16)", "decision|flux"),
        ("resize(product, 31) + 128", "resize(product, 31)", "decision|flux"),
    ],
)
def test_a_fault_is_seen(old: str, new: str, check: str, tmp_path: Path) -> None:
    with pytest.raises(CheckError, match=rf"^({check}): .*expected"):
        bench(tmp_path, old=old, new=new)


def test_the_package_is_what_the_command_writes() -> None:
    drive = load_drive(ROOT / "drives" / "anpc5l_6kv.toml")
    found = registers.values(drive, clock=CLOCK)
    text = boot.format_vhdl(drive, found, "anpc5l_6kv.toml")
    assert (EXAMPLE / "drive_registers.vhd").read_text(encoding="utf-8") == text + "\n"


def test_fusesoc_builds_it(tmp_path: Path) -> None:
    done = build("directmpc:examples:fabric_system", [RTL, EXAMPLE], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
