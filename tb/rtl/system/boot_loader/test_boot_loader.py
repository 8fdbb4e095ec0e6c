"""A boot without a host: every entry of a ROM over AXI4-Lite, or a failure that says where.

Stimulus: ROMs of random length with every operation and the corners of address and word, behind a
register and without one; a slave at full speed and one that takes its time; accesses that are
refused, words that are lost, a slave that refuses for ever; resets in any clock of a boot, behind
refusals and before a word is read back.
Checks: every access in order, its address and word, against the model; the outcome, its place, that
it stays, and that nothing follows it; the entries that `make registers` writes.
Faults: no second try, a word that is not compared, errors taken for answers, a reset that keeps a
part of the state, and others.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import boot, registers
from directmpc.host.boot import Access, Outcome
from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome as Found
from tb.helpers.simulation import run

NAME = "boot_loader"


def bench(rtl: Path = RTL, boots: int = 30) -> Found:
    return run(
        NAME, generics={"TRIES": 8, "LIMIT": 200}, arguments={"boots": boots, "seed": 5}, rtl=rtl
    )


def test_every_access_is_the_models() -> None:
    assert bench(boots=60).covered["done"] >= 20


#: Checks that a fault fails, whichever comes first.
SEEN = "(access|outcome|early|waits|silence)"


test_a_fault_is_seen = seen(
    NAME,
    bench,
    ("if (response /= OKAY) then", "if (false) then", SEEN),
    ("v.tried := 0;\n        v.phase", "v.phase", SEEN),
    ("forward := rdata = word;", "forward := true;", SEEN),
    ("(rdata and word) /=", "rdata /=", SEEN),
    ("r.tried = TRIES - 1", "r.tried = TRIES - 2", SEEN),
    ("          v.phase := FETCH;", "          v.phase := BEGINS;", SEEN),
    ('address <= "00" & entry(45', 'address <= "00" & not entry(45', SEEN),
    ("not (entry(47) or entry(46))", "not entry(47)", SEEN),
    ("v := STATE_INIT;", "v := (FETCH, STATE_INIT.place, '0', r.tried);", SEEN),
    ("v := STATE_INIT;", "v := STATE_INIT; if (r.back = '1') then v.back := '1'; end if;", SEEN),
)


class Registers:
    """Registers that refuse some writes, and are busy with a commit for some reads."""

    def __init__(self, refused: int, busy: int) -> None:
        self.words: dict[int, int] = {}
        self.refused, self.busy = refused, busy
        self.order: list[int] = []

    def access(self, asked: Access) -> tuple[int, int]:
        """The answer to an access."""
        if asked.address == 0x014:
            self.busy -= 1
            return boot.OKAY, 2 * int(self.busy >= 0)
        if asked.write and self.refused:
            self.refused -= 1
            return 2, 0
        if asked.write:
            self.words[asked.address] = asked.word
            self.order.append(asked.address)
        return boot.OKAY, self.words.get(asked.address, 0)


@pytest.mark.parametrize("name", ["anpc5l_6kv", "induction_2kw2"])
@pytest.mark.parametrize("use_observer", [True, False])
def test_the_rom_of_a_drive_sets_every_register_and_enables_last(
    name: str, *, use_observer: bool
) -> None:
    found = registers.values(load_drive(name))
    entries = boot.rom(found, use_observer=use_observer)
    held = Registers(refused=22, busy=9)
    assert boot.boot(entries, 64, held.access) == Outcome(done=True, place=len(entries) - 1)
    wanted = {address: word for _, address, word in found.writes()}
    control = 0b1101 if use_observer else 0b1001
    assert held.words == wanted | {0x00C: control}
    assert held.order[-2:] == [0x010, 0x00C]
    assert entries[-3].operation == boot.WRITE
    assert entries[-2].operation == boot.WAIT


def test_the_package_has_the_rom() -> None:
    drive = load_drive("anpc5l_6kv")
    found = registers.values(drive)
    text = boot.format_vhdl(drive, found, "anpc5l_6kv.toml")
    rows = re.findall(r'^ +(\d+) => x"([0-9A-F]{12})"', text, re.M)
    entries = boot.rom(found)
    assert [int(place) for place, _ in rows] == list(range(len(entries)))
    assert [int(word, 16) for _, word in rows] == [entry.bits() for entry in entries]
    assert "constant COUNTS_IS_ALPHA : real := 16000.0;" in text


def test_only_the_package_asks_for_the_flux(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        registers.main(["anpc5l_6kv", "--measured-flux"])
    assert "--measured-flux: only with --vhdl" in capsys.readouterr().err
