"""Register map and register values.

Sweep: both controllers, all shipped drives.
Checks: every parameter port of the cores has a register of its width and no two share an
address; the fixed lower half is alike; values are those of the cores' own tables; what does not fit
saturates and is named on the safe side, and is refused on the other; the C array compiles and holds
the CSV's words; what one explorer cannot keep is said, what no core can keep is refused.
Does not prove: what the registers do, see test_system.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import re
import subprocess
from math import ceil, floor
from pathlib import Path

import pytest

from directmpc.api.drive_file import load_drive, load_mpdcc_drive
from directmpc.drive_tables import GuardTable, keys_of
from directmpc.host import registers
from directmpc.host.registers import registers_of
from directmpc.mpdcc import cycles as mpdcc_cycles
from directmpc.mpdcc import formats
from directmpc.mpdcc.coefficients import registers as mpdcc_registers
from directmpc.mpdcc.drive import Drive
from directmpc.mptc.drive import MptcDrive
from scripts.generate import register_files
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.shared.tools import ROOT
from tb.helpers.drives import plain_text
from tb.helpers.faults import file_of

DRIVES = sorted((ROOT / "drives").glob("*.toml"))


def ports_of(entity: str) -> dict[str, int]:
    """Parameter ports of a core: name to width."""
    text = file_of(entity).read_text(encoding="utf-8")
    head = text[text.index("entity") : text.index("-- decision")]
    package = {"mpdcc_core": "directmpc_constants"}.get(entity, entity.replace("core", "constants"))
    constants = file_of(package).read_text(encoding="utf-8")
    widths = dict(re.findall(r"constant (\w+_WIDTH) *: natural *:= (\d+)", constants))
    found = re.findall(r"^ *(\w+) *: *in *std_logic_vector\((.+?) downto 0\)", head, re.M)
    # "WIDTH - 2 downto 0" has a bit less than the constant
    parts = {name: re.match(r"(\w+)(?: - (\d))?$", bound) for name, bound in found}
    return {
        name: int(widths[part[1]]) + 1 - int(part[2]) if part[1] in widths else int(part[1]) + 1
        for name, part in parts.items()
        if part
    }


@pytest.mark.parametrize("path", DRIVES, ids=lambda path: path.stem)
def test_every_shipped_drive_can_be_started(path: Path) -> None:
    assert load_drive(path).missing() == []


@pytest.mark.parametrize("controller", register_files.CONTROLLERS)
def test_every_port_has_a_register_of_its_width(controller: str) -> None:
    ports = ports_of(f"{controller}_core")
    assert len(ports) > 20
    known = registers_of(controller)
    for name, width in ports.items():
        (place,) = [n for n in known if n.endswith(f".{name}")]
        (fields,) = known[place][1].values()
        assert fields[1] == width, name


def test_addresses_are_unique_and_the_lower_half_is_alike() -> None:
    for known in map(registers_of, register_files.CONTROLLERS):
        addresses = [address for address, _ in known.values()]
        assert len(set(addresses)) == len(addresses)
        assert max(addresses) < 1024
    # but for the bands of capacitors, which a two-level inverter does not have
    lower = [
        {n: r for n, r in known.items() if r[0] < 0x80 and not n.startswith("bands.")}
        for known in map(registers_of, register_files.CONTROLLERS)
    ]
    assert lower[0] == lower[1]


@pytest.mark.parametrize("path", DRIVES, ids=lambda path: path.stem)
def test_a_drive_becomes_register_values(path: Path) -> None:
    drive = load_drive(path)
    found = registers.values(drive)
    # registers of parts that a plain system lacks: known by their parts alone
    parts = ("family", "sensorless") if found.controller == "mptc" else ()
    complete = registers.values(drive, built=parts)
    assert found.saturated == [] == complete.saturated
    own = ("parameters.", "guard.", "bands.")
    known = {n for n in registers_of(found.controller) if n.startswith(own)}
    assert set(complete.words) == known
    names = {"family_method", "duty_rule", "rate", "sensorless", "c_gain_speed", "c_gain_integral"}
    assert known - set(found.words) == ({f"parameters.{n}" for n in names} if parts else set())
    for name, (_, fields) in registers_of(found.controller).items():
        if name.startswith(own):
            ((_, width, signed),) = fields.values()
            low, high = (-(1 << width - 1), 1 << width - 1) if signed else (0, 1 << width)
            assert low <= complete.words[name] < high, name
            assert found.words.get(name, 0) in range(low, high), name
    if found.controller == "mpdcc":
        for port, value in mpdcc_registers(drive, "fast").ports().items():
            assert found.words[f"parameters.{port}"] == value
    if found.controller == "kbest":
        assert found.words["parameters.effort"] == round(drive.control.lambda_u * 15_625)
        assert found.words["parameters.short_stages"] == drive.control.short_stages
    # the file's dead time or longer, and one and a half control periods or less, at 25 MHz
    assert found.words["guard.dead_time"] == ceil(round(25e6 * drive.guard.dead_time, 6))
    assert found.words["guard.watchdog"] == floor(round(25e6 * 1.5 * drive.control.ts, 6))
    assert found.writes()[-1][0] == "system.command"


def test_a_duty_rule_becomes_a_word_where_the_method_has_one() -> None:
    drive = load_drive(ROOT / "drives" / "induction_2kw2.toml")
    for word, rule in enumerate(("deadbeat", "mean", "best")):
        for method in ("MPTC1", "MPTC2"):
            found = registers.values(drive.with_control(method=method, duty_rule=rule))
            assert found.words["parameters.duty_rule"] == word
        found = registers.values(drive.with_control(method="GTV", duty_rule=rule))
        assert found.words["parameters.duty_rule"] == 0


def with_guard(name: str, **keys: float | None) -> Drive | MptcDrive:
    """A shipped drive whose guard is set to something else."""
    return load_drive(name).changed(guard=keys)


def test_what_does_not_fit_is_named_and_safe() -> None:
    drive = with_guard("anpc5l_6kv", decision_limit=4e-3, watchdog=3e-3)
    found = registers.values(drive)
    clipped = ["decision_limit", "watchdog"]
    assert [text.partition(":")[0] for text in found.saturated] == [f"guard.{n}" for n in clipped]
    for name in clipped:
        assert found.words[f"guard.{name}"] == 2**16 - 1
    # rounded to the safe side
    drive = with_guard(
        "anpc5l_6kv", dead_time=2.01e-6, watchdog=75.03e-6, current_limit=1.00001,
        link_high=2.5, link_low=1.5,
    )  # fmt: skip
    found = registers.values(drive)
    assert found.saturated == []
    assert found.words["guard.dead_time"] == 51
    assert found.words["guard.watchdog"] == 1875
    assert found.words["guard.current_limit"] == 16_000
    level = formats.LINK_VOLTAGE.scale
    assert found.words["guard.link_high"] == math.floor(2.5 * level) < 2.5 * level
    assert found.words["guard.link_low"] == math.ceil(1.5 * level) > 1.5 * level


@pytest.mark.parametrize(
    ("name", "asked", "allowed"),
    [
        ("dead_time", 1e-3, "25000 clocks of 25 MHz; it must be at most 0.0001638 s, 4095 clocks"),
        ("minimum_on", 163.81e-6, "at most 0.0001638 s"),
        ("minimum_off", 1e-3, "at most 0.0001638 s"),
        ("current_limit", 32.0, "at most 31.9990234"),
        ("dead_time", 2.0, "guard.dead_time: got 2.0; it must be a number from 1e-09 to 0.001 s"),
        ("link_low", 0.75, "guard.link_low: got 0.75 V; it must be a number from 270 to 540 V"),
        ("link_high", 1.25, "guard.link_high: got 1.25 V; it must be a number from 540 to 1080 V"),
        ("clock", 0.0, "clock: got 0 Hz; it must be from 1 to 1000 MHz"),
    ],
)
def test_what_would_be_less_safe_is_an_error(name: str, asked: float, allowed: str) -> None:
    path = ROOT / "drives" / "induction_2kw2.toml"
    clock = asked if name == "clock" else registers.CORE_CLOCK
    keys = {} if name == "clock" else {name: asked}
    with pytest.raises(ValueError, match=name) as refused:
        registers.values(load_drive(path).changed(guard=keys), clock=clock)
    assert allowed in str(refused.value)
    status, text, complaints = command(str(path), f"--{name.replace('_', '-')}", str(asked), "--c")
    assert (status, text) == (2, "")
    assert complaints == f"registers: {path}: {refused.value}\n"


@pytest.mark.parametrize(
    ("name", "key", "just", "beyond", "most"),
    [
        ("anpc5l_6kv", "current_limit", 2.0478, None, ""),
        ("anpc5l_6kv", "link_high", 4.0, None, ""),
        ("induction_2kw2", "current_limit", 31.999, 32.0, "31.9990234"),
        ("induction_2kw2", "link_high", 1079.96, 1079.99, "1079.96704"),
    ],
)
def test_a_limit_that_could_never_trip_is_an_error(
    name: str, key: str, just: float, beyond: float | None, most: str
) -> None:
    register = f"guard.{key}"
    found = registers.values(with_guard(name, **{key: just}))
    assert found.words[register] <= registers.HIGHEST[register, "value"]
    assert found.writes()
    if beyond is not None:
        with pytest.raises(ValueError, match=register) as refused:
            registers.values(with_guard(name, **{key: beyond}))
        assert f"at most {most}" in str(refused.value)
    # nor can it be written by name
    found.words[register] = registers.HIGHEST[register, "value"] + 1
    with pytest.raises(ValueError, match=f"{register}: value = .* from 0 to"):
        found.writes()


def test_the_longest_times_fit() -> None:
    longest = 0.0001638
    drive = with_guard(
        "induction_2kw2", dead_time=longest, minimum_on=longest, minimum_off=longest, link_low=540.0
    )
    found = registers.values(drive)
    assert found.saturated == []
    for name in ("dead_time", "minimum_on", "minimum_off"):
        assert found.words[f"guard.{name}"] == 4095
    assert found.words["guard.link_low"] == 32768
    # a negative trip level would become one of 0
    with pytest.raises(ValueError, match=r"guard.current_limit: .* from 0.001"):
        with_guard("induction_2kw2", current_limit=-1.0)


@pytest.mark.parametrize("name", ["anpc5l_6kv", "induction_2kw2"])
@pytest.mark.parametrize("clock", [25e6, 100e6])
def test_a_time_is_the_same_time_at_every_clock(name: str, clock: float) -> None:
    found = registers.values(with_guard(name, dead_time=3e-6), clock=clock)
    for key, time in (("dead_time", 3e-6), ("minimum_on", 4e-6), ("watchdog", 75e-6)):
        assert found.words[f"guard.{key}"] / clock == pytest.approx(time)
        assert found.nanoseconds(f"guard.{key}") == pytest.approx(1e9 * time)
    assert found.nanoseconds("guard.current_limit") is None
    path = ROOT / "drives" / f"{name}.toml"
    for layout in ("--table", "--c"):
        _, text, _ = command(str(path), layout, "--clock", f"{clock:g}")
        (line,) = [row for row in text.splitlines() if "guard.dead_time" in row]
        assert f"2000 ns at {clock / 1e6:g} MHz" in line


@pytest.mark.parametrize("name", ["anpc5l_6kv", "induction_2kw2"])
def test_what_a_file_does_not_say_lets_no_gate_come_on(name: str, tmp_path: Path) -> None:
    text = (ROOT / "drives" / f"{name}.toml").read_text(encoding="utf-8")
    path = tmp_path / "drive.toml"
    path.write_text(re.sub(r"\[guard\].*?(?=\n\[)", "", text, flags=re.S), encoding="utf-8")
    drive = load_drive(path)
    needed = [key for key in keys_of(type(drive.guard)) if key not in GuardTable.OPTIONAL]
    assert len(needed) > 5
    found = registers.values(drive)
    assert [text.split(":")[0] for text in found.missing] == [f"guard.{key}" for key in needed]
    assert found.words["guard.dead_time"] == found.words["guard.minimum_off"] == 4095
    assert found.words["guard.current_limit"] == found.words["guard.link_high"] == 0
    assert found.words["guard.link_low"] == 2**16 - 1
    status, shown, complaints = command(str(path))
    assert status == 0
    assert shown.startswith("register,address,word,value\n")
    assert complaints.splitlines()[0] == (
        f"registers: {path}: no gate comes on: guard.dead_time: missing; it must be a number from "
        "1e-09 to 0.001 s"
    )
    assert complaints.count("\n") == len(needed)
    # each key may be given one by one
    shipped = load_drive(name).guard
    given = [f"--{key.replace('_', '-')}={getattr(shipped, key)}" for key in needed]
    assert command(str(path), *given) == command(str(ROOT / "drives" / f"{name}.toml"))


def command(*arguments: str) -> tuple[int, str, str]:
    """Status, output and complaints of the command."""
    out, complaints = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(complaints):
        status = registers.main(arguments)
    return status, out.getvalue(), complaints.getvalue()


def test_make_runs_the_command() -> None:
    # nothing of how these tests were started
    make = ["env", "-u", "ARGS", "-u", "MAKEFLAGS", "make", "-s", "-C", str(ROOT), "registers"]
    drive = f"DRIVE={ROOT / 'drives' / 'induction_2kw2.toml'}"
    done = subprocess.run([*make, drive], capture_output=True, text=True, check=False)
    path = drive.removeprefix("DRIVE=")
    assert done.stdout == command(path)[1] == command(path, "--csv")[1]
    # an option that has nothing to do with the layout leaves it alone
    slower = [*make, drive, "ARGS=--clock 20e6"]
    done = subprocess.run(slower, capture_output=True, text=True, check=False)
    assert done.stdout.startswith("register,address,word,value\n")
    assert "\nguard.dead_time,0x040,0x00000028,40\n" in done.stdout
    done = subprocess.run(make, capture_output=True, text=True, check=False)
    assert "registers: DRIVE is not set" in done.stderr


def test_the_command_takes_the_clock() -> None:
    drive = str(ROOT / "drives" / "anpc5l_6kv.toml")
    found = {}
    for clock, given in ((25e6, ()), (50e6, ("--clock", "50e6"))):
        rows = csv.DictReader(io.StringIO(command(drive, "--csv", *given)[1]))
        found[clock] = {row["register"]: int(row["value"]) for row in rows}
        assert found[clock]["guard.dead_time"] == round(2e-6 * clock)
        assert found[clock]["guard.watchdog"] == round(75e-6 * clock)
    for name in found[25e6]:
        assert name.startswith("guard.") or found[25e6][name] == found[50e6][name]


def test_the_command_prints_a_table() -> None:
    drive = str(ROOT / "drives" / "induction_2kw2.toml")
    _, text, _ = command(drive, "--table")
    rows = [tuple(line.split()[:4]) for line in text.splitlines()]
    parts = csv.reader(io.StringIO(command(drive)[1]))
    assert [tuple(row) for row in parts][1:] == rows


def test_the_command_prints_c_and_csv(tmp_path: Path) -> None:
    drive = str(ROOT / "drives" / "induction_2kw2.toml")
    rows = list(csv.DictReader(io.StringIO(command(drive, "--csv")[1])))
    assert rows[-1] == {
        "register": "system.command",
        "address": "0x010",
        "word": "0x00000001",
        "value": "1",
    }
    _, text, complaints = command(drive, "--c", "--watchdog", "0.5")
    assert "saturated: guard.watchdog" in text
    assert "saturated: guard.watchdog" in complaints
    source = tmp_path / "registers.c"
    source.write_text(
        command(drive, "--c")[1]
        + f'#include "{ROOT / "registers" / "directmpc_mptc.h"}"\n'
        + "#include <stdio.h>\n#include <stddef.h>\n"
        + "int main(void) { for (unsigned i = 0; i < sizeof directmpc_registers / 8; i++)"
        + ' printf("0x%03X,0x%08X\\n", directmpc_registers[i].address,'
        + " (unsigned)directmpc_registers[i].word);\n"
        + "return offsetof(directmpc_mptc_t, parameters) != 0x100; }\n",
        encoding="utf-8",
    )
    program = tmp_path / "registers"
    subprocess.run(["cc", "-Wall", "-Werror", str(source), "-o", str(program)], check=True)
    printed = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
    assert printed.split() == [f"{row['address']},{row['word']}" for row in rows]


def test_a_bad_drive_is_one_line(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text('controller = "mpdcc"\n', encoding="utf-8")
    status, text, complaints = command(str(bad))
    assert (status, text) == (2, "")
    assert len(complaints.splitlines()) == 1
    assert "bad.toml" in complaints


def test_the_paper_variant_is_not_given_what_it_cannot_do(tmp_path: Path) -> None:
    drive = tmp_path / "sese.toml"
    text = (ROOT / "drives" / "anpc5l_6kv.toml").read_text(encoding="utf-8")
    assert '"SE"   #' in text
    drive.write_text(text.replace('"SE"   #', '"SESE" #', 1), encoding="utf-8")
    assert command(str(drive))[0] == 0
    status, text, complaints = command(str(drive), "--variant", "paper")
    assert (status, text) == (2, "")
    assert complaints.startswith(f"registers: {drive}: control.switching_horizon")
    assert len(complaints.splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "settings", "given", "words"),
    [
        ("anpc5l_6kv", {}, (), None),
        ("anpc5l_6kv", {}, ("--clock", "1.75e6"), r"up to 89 clocks .* 78 .* 1\.997 MHz"),
        (
            "anpc5l_6kv",
            {},
            ("--variant", "paper"),
            "up to 1467 clocks .* 19 of them before the core .* 1125 .* more explorers",
        ),
        (
            "anpc5l_6kv",
            {"switching_horizon": "SESE"},
            (),
            r"got none; .*3489 clocks.* a budget of at most 947",
        ),
        ("anpc5l_6kv", {"switching_horizon": "SESE", "budget": 400}, (), None),
        ("anpc5l_6kv", {"switching_horizon": "SESE", "budget": 940}, (), None),
        # delay compensation: the prediction takes 33 clocks, a decision has all of its period
        (
            "anpc5l_6kv",
            {"switching_horizon": "SESE", "budget": 960, "delay_compensation": True},
            (),
            None,
        ),
        (
            "anpc5l_6kv",
            {"switching_horizon": "SESE", "budget": 1100, "delay_compensation": True},
            (),
            r"got 1100; .* next start comes after 1250 \(control.ts\) .* a budget of at most 1039",
        ),
        # what is asked for holds
        (
            "anpc5l_6kv",
            {"switching_horizon": "SESE", "budget": 960, "delay_compensation": True},
            ("--decision-limit", "45e-6"),
            r"got 960; .* a budget of at most 914",
        ),
        ("motulator_2kw2", {}, ("--clock", "1e6"), None),
        ("motulator_2kw2", {"method": "MPFC"}, ("--clock", "2e6"), None),
    ],
)
def test_what_one_explorer_cannot_keep_is_refused(
    name: str, settings: dict[str, object], given: tuple[str, ...], words: str | None,
    tmp_path: Path,
) -> None:  # fmt: skip
    path = written(tmp_path, name, settings)
    status, text, complaints = command(str(path), *given)
    if words is None:
        assert (status, complaints) == (0, "")
        assert text.startswith("register,address,word,value")
    else:
        assert (status, text) == (2, "")
        assert re.search(words, complaints), complaints
        assert complaints.startswith(f"registers: {path}: ")
        assert complaints.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "ts", "guard", "words"),
    [
        ("anpc5l_6kv", 20e-6, {}, None),
        ("anpc5l_6kv", 20e-6, {"minimum_off": 10e-6}, None),  # 5 x 2 us and 10 us
        ("anpc5l_6kv", 20e-6, {"minimum_off": 10.1e-6},
         "20 us; .* 20.1 us .*5 x guard.dead_time and guard.minimum_off.* 20.1 us at least"),
        ("anpc5l_6kv", 50e-6, {"minimum_on": 41e-6}, "50 us; .*51 us .*guard.minimum_on"),
        ("anpc5l_6kv", 50e-6, {"minimum_on": None, "dead_time": 1e-3}, None),
        ("induction_2kw2", 20e-6, {"minimum_on": 18e-6}, None),
        ("induction_2kw2", 20e-6, {"minimum_on": 18.5e-6},
         r"20 us; .* 20.5 us .*\(guard.dead_time and guard.minimum_on\)"),
    ],
)  # fmt: skip
def test_a_period_shorter_than_a_move_is_refused(
    name: str, ts: float, guard: dict[str, float | None], words: str | None
) -> None:
    drive = load_drive(name).changed(control={"ts": ts}, guard=guard)
    with (
        pytest.raises(ValueError, match=f"^control.ts: got {words}")
        if words
        else (contextlib.nullcontext())
    ):
        registers.refuse_short(drive)


def test_the_command_names_the_time_of_a_move(capsys: pytest.CaptureFixture) -> None:
    path = str(ROOT / "drives" / "anpc5l_6kv.toml")
    assert registers.main([path, "--minimum-on", "45e-6"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith(f"registers: {path}: control.ts: got 50 us; a leg takes up to 55 us")


def written(folder: Path, name: str, settings: dict[str, object]) -> Path:
    """A drive file like a shipped one, with other settings."""
    text = plain_text(name)
    for key, value in settings.items():
        text = re.sub(rf"^{key} = .*\n", "", text, flags=re.M)
        text = text.replace("[control]", f"[control]\n{key} = {json.dumps(value)}")
    path = folder / "drive.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "settings", "given", "words"),
    [
        # 70 clocks with four explorers and more, 19 of the observer before; 0.9 of 50 us
        ("anpc5l_6kv", {}, ("--clock", "1.5e6"), "up to 89 clocks .* 67 .*1.993 MHz"),
        # 8 more of the filters
        ("anpc5l_6kv", {"capacitor_filter": 4}, ("--clock", "1.5e6"), "up to 97 clocks"),
        ("anpc5l_6kv", {"delay_compensation": True}, ("--clock", "2e6"), "up to 122 clocks"),
        ("anpc5l_6kv", {"switching_horizon": "SESE"}, ("--clock", "1.5e6"), "up to 89 clocks"),
        ("motulator_2kw2", {"ts": 39e-6}, ("--clock", "1e6"), r"up to 40 clocks .* 39 \(control"),
        ("motulator_2kw2", {"method": "MPFC"}, ("--clock", "1.5e6"), "up to 79 clocks"),
    ],
)
def test_what_no_core_can_keep_is_refused(
    name: str, settings: dict[str, object], given: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    path = written(tmp_path, name, settings)
    status, text, complaints = command(str(path), *given)
    assert (status, text) == (2, "")
    assert re.search(words, complaints), complaints
    assert complaints.count("\n") == 1
    # a simulator in lock-step waits as long as it takes
    status, text, complaints = command(str(path), *given, "--decision-limit", "3e-3")
    assert (status, complaints) == (0, "")


def test_the_bounds_of_a_decision_are_the_budgets() -> None:
    for explorers in range(1, 9):
        for variant in ("fast", "paper"):
            wanted = worst_cycles(variant, explorers)
            assert mpdcc_cycles.decision(explorers, variant) == wanted
        options = {"second_level": True, "compensate": True}
        wanted = worst_cycles("fast", explorers, two_switchings=True, compensate=True)
        assert mpdcc_cycles.decision(explorers, **options) == wanted


def test_ports_of_a_register_block_without_a_known_meaning_are_an_error() -> None:
    block = "    port (\n        clk : in std_logic;\n        irq : out std_logic\n    );\n"
    with pytest.raises(ValueError, match="clk, irq"):
        register_files._described(block + "end entity x;\n")


def test_what_comes_before_a_core_counts() -> None:
    assert clocks_of("mptc_speed_observer", "speed") == registers.SPEED_KNOWN
    for filters, figure in ((0, "flux"), (4, "filtered")):
        drive = load_mpdcc_drive("anpc5l_6kv").with_control(capacitor_filter=filters)
        found = registers.values(drive, clock=1e6)
        with pytest.raises(ValueError, match=f"up to {clocks_of('state_observer', figure) + 70} "):
            registers.refuse_slow(drive.with_control(delay_compensation=False), found)
