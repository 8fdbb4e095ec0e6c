"""The example beside a processor: the C driver, compiled, and the system that it drives.

Sweep: none.
Stimulus: the driver on a bus of Python's that refuses, answers wrongly or does not commit; then a
closed loop of the 6 kV drive over AXI4-Lite, with and without pauses; a trip; permit taken away;
random states, ties, rails, huge values and such that are not finite, on ARM and AArch64 too.
Checks: what the driver returns, and that it wrote nothing where it refuses; every decision is the
model's with the observer's flux; words are the Python host's; the interrupt comes and goes; the
gates go off and on again.
Faults: an interrupt that a decision does not raise; two measurements in each other's place.
Timing: a decision interrupts within LONGEST_DECISION.
Does not prove: the system itself, see test_system.
"""

from __future__ import annotations

import ctypes
import math
import random
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from directmpc.api.drive_file import load_drive
from directmpc.host import registers
from directmpc.host.measurements import Encoder
from directmpc.mpdcc import formats
from directmpc.states import MpdccState, StateError
from scripts.hdl.ghdl import CheckError
from tb.helpers.drives import plain_file
from tb.helpers.simulation import Outcome, run
from tb.rtl.system.processor_system.driver import (
    BUS,
    BUSY,
    NOT_FINITE,
    OK,
    OTHER_MAP,
    RANGE,
    TIMEOUT,
    TRIPPED,
    UNKNOWN,
    Driver,
    Measurement,
    System,
    Write,
)

ROOT = Path(__file__).resolve().parents[4]
EXAMPLE = ROOT / "examples" / "processor"
DRIVE = plain_file("anpc5l_6kv")
COMMIT_PENDING, BUSY_BIT, ENABLE, START, COMMIT = 2, 1, 1, 2, 1


def compiled(folder: Path, old: str = "", new: str = "") -> Path:
    """The driver, the example and the test's part as a library; ``old`` replaced by ``new``."""
    drive = load_drive(DRIVE)
    found = registers.values(drive, clock=100e6)
    text = registers.format_c(drive, found, DRIVE.name)
    (folder / "drive.h").write_text(text + "\n", encoding="utf-8")
    driver = (EXAMPLE / "directmpc.c").read_text(encoding="utf-8")
    assert not old or driver.count(old) == 1
    (folder / "driver.c").write_text(driver.replace(old, new) if old else driver, encoding="utf-8")
    library = folder / "driver.so"
    sources = [folder / "driver.c", EXAMPLE / "drive_control.c", Path(__file__).parent / "rig.c"]
    warnings = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    includes = [f"-I{path}" for path in (EXAMPLE, ROOT / "registers", folder)]
    command = ["cc", *warnings, *includes, "-shared", "-fPIC", *map(str, sources)]
    subprocess.run([*command, "-o", str(library)], check=True)
    return library


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled(tmp_path_factory.mktemp("driver"))


class Registers:
    """A bus with registers that hold what is written, and a system that obeys at once."""

    def __init__(self) -> None:
        self.words = {0x000: 0x444D5043, 0x004: 0x01000100, 0x008: 0x00640011, 0x014: 0, 0x01C: 0}
        self.writes: list[tuple[int, int]] = []
        self.refused: set[int] = set()

    def write(self, address: int, word: int) -> None:
        """A write of the driver's."""
        if address in self.refused:
            raise OSError(address)
        self.writes.append((address, word))
        if address != 0x014:
            self.words[address] = 0 if address == 0x01C else word

    def read(self, address: int) -> int:
        """A read of the driver's."""
        if address in self.refused:
            raise OSError(address)
        return self.words.get(address, 0)


@pytest.fixture
def opened(library: Path) -> tuple[Registers, Driver, System]:
    bus = Registers()
    driver, system = Driver(library, bus.write, bus.read), System()
    assert driver.directmpc_open(ctypes.byref(system), driver.bus, 0) == OK
    assert bus.writes == [(0x00C, 0b1010)], "gates off, measurements from registers, own positions"
    bus.writes.clear()
    return bus, driver, system


@pytest.mark.parametrize(
    ("address", "word", "status"),
    [
        (0x000, 0, UNKNOWN),
        (0x008, 0x00640012, UNKNOWN),
        (0x004, 0x02000100, OTHER_MAP),
        (0x000, None, BUS),
        (0x00C, None, BUS),
    ],
)
def test_only_a_system_that_it_knows_is_opened(
    library: Path, address: int, word: int | None, status: int
) -> None:
    bus = Registers()
    if word is None:
        bus.refused.add(address)
    else:
        bus.words[address] = word
    driver = Driver(library, bus.write, bus.read)
    assert driver.directmpc_open(ctypes.byref(System()), driver.bus, 0) == status
    assert bus.writes == []


def test_a_drive_is_loaded_with_the_gates_off(opened: tuple[Registers, Driver, System]) -> None:
    bus, driver, system = opened
    writes = (Write * 3)((0x040, 7), (0x100, 0xFFFF), (0x010, COMMIT))
    assert driver.directmpc_load(ctypes.byref(system), writes, 3) == OK
    assert bus.writes[0] == (0x00C, 0b1010)
    assert bus.writes[1:4] == [(0x040, 7), (0x100, 0xFFFF), (0x010, COMMIT)]
    assert bus.writes[4:] == [(0x010, 0b1100)], "estimate and counters begin anew"
    bus.words[0x014] = COMMIT_PENDING
    assert driver.directmpc_load(ctypes.byref(system), writes, 3) == TIMEOUT


@pytest.mark.parametrize("address", [0x00C, 0x03C, 0x06C, 0x07C, 0x0FC, 0x102, 0x200, 0x2A0])
def test_what_is_no_setting_of_a_drive_is_not_loaded(
    opened: tuple[Registers, Driver, System], address: int
) -> None:
    bus, driver, system = opened
    writes = (Write * 2)((0x100, 1), (address, 1))
    assert driver.directmpc_load(ctypes.byref(system), writes, 2) == RANGE
    assert bus.writes == []


@pytest.mark.parametrize(
    ("name", "value", "status"),
    [
        ("is_beta", -32768, OK),
        ("is_beta", -32769, RANGE),
        ("omega_r", 32767, OK),
        ("omega_r", 32768, RANGE),
        ("v_ph_c", 65535, OK),
        ("v_ph_c", 65536, RANGE),
        ("v_dc", -1, RANGE),
    ],
)
def test_a_measurement_fits_or_nothing_is_written(
    opened: tuple[Registers, Driver, System], name: str, value: int, status: int
) -> None:
    bus, driver, system = opened
    given = Measurement(**{name: value})
    assert driver.directmpc_begin(ctypes.byref(system), ctypes.byref(given)) == status
    if status == RANGE:
        assert bus.writes == []
        return
    address = registers.registers_of("mpdcc")[f"measurements.{name}"][0]
    assert dict(bus.writes)[address] == value & 0xFFFF
    assert bus.writes[-1] == (0x010, START)
    assert driver.directmpc_begin(ctypes.byref(system), ctypes.byref(given)) == BUSY


def test_faults_keep_a_drive_from_starting(opened: tuple[Registers, Driver, System]) -> None:
    bus, driver, system = opened
    bus.words[0x01C] = 0x20
    assert driver.directmpc_start(ctypes.byref(system)) == TRIPPED
    assert bus.writes == []
    assert driver.directmpc_clear(ctypes.byref(system)) == OK
    assert bus.writes == [(0x00C, 0b1010), (0x01C, 0x20)]
    assert driver.directmpc_start(ctypes.byref(system)) == OK
    assert bus.writes[-1] == (0x00C, 0b1010 | ENABLE)
    assert driver.directmpc_stop(ctypes.byref(system)) == OK
    assert bus.writes[-1] == (0x00C, 0b1010)


#: Compiler, its machine's options, and what runs its programs; none for this machine.
MACHINES = {
    "this": (("cc",), ()),
    "ARM": (("arm-linux-gnueabihf-gcc", "-static"), ("qemu-arm",)),
    "AArch64": (("aarch64-linux-gnu-gcc", "-static"), ("qemu-aarch64",)),
}
ORDER = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "iref_alpha", "iref_beta",
         "omega_s", "omega_r", "v_dc")  # fmt: skip


def states() -> list[list[float]]:
    """Values in the order of ORDER: random ones, ties and their neighbours, rails, huge, none."""
    rng = random.Random(8)
    scales = [formats.MEASUREMENTS[name].scale for name in ORDER]
    found = [[rng.uniform(-5, 5) for _ in ORDER] for _ in range(500)]
    for number in (*range(-6, 7), -32769, -32768, -32767, 32766, 32767, 32768, 65534, 65535, 65536):
        for part in (0.0, 0.5, -0.5):
            exact = [(number + part) / scale for scale in scales]
            found += [exact, [math.nextafter(v, 9e9) for v in exact]]
            found += [[math.nextafter(v, -9e9) for v in exact]]
    # ties of a scale that is a power of two times an integer are exact; those of 64012.5 are not
    found += [[rng.choice((-1, 1)) * (rng.randrange(70000) + 0.5) / s for s in scales]
              for _ in range(2000)]  # fmt: skip
    for value in (0.0, -0.0, 5e-324, 1e5, 1.4e5, 1e6, -1e6, 1e300, -1e300, 1.7e308):
        found.append([value] * len(ORDER))
    for value in (math.nan, -math.nan, math.inf, -math.inf):
        for place in range(len(ORDER)):
            found.append([0.5] * place + [value] + [0.5] * (len(ORDER) - place - 1))
    return found


def in_python(encoder: Encoder, row: list[float]) -> list[int] | None:
    """Words of a state as the Python host sends them; None where it refuses the state."""
    x = dict(zip(ORDER, row, strict=True))
    try:
        state = MpdccState(
            current=complex(x["is_alpha"], x["is_beta"]),
            flux=0j,
            v_n=x["v_n"],
            v_ph=(x["v_ph_a"], x["v_ph_b"], x["v_ph_c"]),
            current_ref=complex(x["iref_alpha"], x["iref_beta"]),
            omega_s=x["omega_s"],
            omega_r=x["omega_r"],
            applied=(0, 0, 0),
            vdc=x["v_dc"],
        )
        words, _, _ = encoder.words(state)
    except StateError:
        return None
    return [word & 0xFFFF for word in words]


@pytest.mark.parametrize(
    "options", [("-O0",), ("-O2",), ("-O3", "-std=gnu11", "-ffp-contract=fast")]
)
@pytest.mark.parametrize("machine", MACHINES)
def test_numbers_become_the_words_of_the_python_host(
    machine: str, options: tuple[str, ...], library: Path, tmp_path: Path
) -> None:
    compiler, emulator = MACHINES[machine]
    for needed in (compiler[0], *emulator[:1]):
        if shutil.which(needed) is None:
            pytest.skip(f"{needed} is missing (Debian: qemu-user, gcc-arm-linux-gnueabihf, "
                        "gcc-aarch64-linux-gnu)")  # fmt: skip
    program = tmp_path / "numbers"
    here = Path(__file__).parent
    sources = [library.parent / "driver.c", EXAMPLE / "drive_control.c", here / "rig.c",
               here / "numbers.c"]  # fmt: skip
    includes = [f"-I{path}" for path in (EXAMPLE, ROOT / "registers", library.parent)]
    warnings = ["-std=c11", "-Wall", "-Wextra", "-Werror"]
    command = [*compiler, *warnings, *options, *includes, *map(str, sources), "-o", str(program)]
    subprocess.run(command, check=True)
    rows = states()
    given = b"".join(struct.pack("<11d", *row) for row in rows)
    done = subprocess.run([*emulator, str(program)], input=given, capture_output=True, check=True)
    encoder = Encoder(load_drive(DRIVE))
    lines = done.stdout.decode().splitlines()
    ended = 0
    for row, line in zip(rows, lines, strict=True):
        status, *words, enabled = map(int, line.split())
        wanted = in_python(encoder, row)
        if wanted is None:
            ended += 1
            assert (status, enabled) == (NOT_FINITE, 0), row
            assert set(words) == {0xFFFFFFFF}, row
        else:
            assert (status, enabled) == (OK, 1), row
            assert words == wanted, row
    assert ended == 4 * len(ORDER)


def bench(
    library: Path, system: Path = EXAMPLE / "processor_system.vhd", steps: int = 24
) -> Outcome:
    return run(
        "processor_system",
        "tb.rtl.system.processor_system.bench_processor",
        units=["mpdcc_system", "gate_release", "sync_bits"],
        files=[system],
        arguments={"seed": 3, "library": str(library), "drive": str(DRIVE), "steps": steps},
        timeout=900,
    )


def test_a_processor_controls_the_drive(library: Path) -> None:
    found = bench(library)
    assert found.checks["decision"] == 28
    assert found.measured["cycles"] <= 150


def test_a_fault_is_seen_in_the_interrupt(library: Path, tmp_path: Path) -> None:
    text = (EXAMPLE / "processor_system.vhd").read_text(encoding="utf-8")
    old = "        unread <= '1';\n"
    assert text.count(old) == 1
    faulty = tmp_path / "processor_system.vhd"
    faulty.write_text(text.replace(old, "        unread <= '0';\n"), encoding="utf-8")
    with pytest.raises(CheckError, match=r"interrupt: none within .* expected one"):
        bench(library, faulty, 2)


def test_a_fault_is_seen_in_the_driver(tmp_path: Path) -> None:
    swapped = "{AT(measurements.iref_alpha), m->iref_beta, 1}"
    faulty = compiled(tmp_path, "{AT(measurements.iref_alpha), m->iref_alpha, 1}", swapped)
    with pytest.raises(CheckError, match=r"decision: .* expected"):
        bench(faulty, steps=4)
