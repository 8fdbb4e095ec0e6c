"""Drive files: the ones that ship, and every way in which one can be wrong."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from directmpc.api.drive_file import load_drive, load_mpdcc_drive, load_mptc_drive, shipped_drives
from directmpc.drive_tables import DriveError, DriveFileError, keys_of
from directmpc.loads.induction import InductionMachine
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.units import per_unit
from directmpc.mptc.drive import MptcDrive
from scripts.commands import drive_info
from tb.helpers.drives import plain_text

DELAY = "delay_compensation"
RULE = "control.deadlock_rule"

MPTC = """
controller = "mptc"
[machine]
rs = 1.2
rr = 1.0
lm = 0.170
ls = 0.175
lr = 0.175
pole_pairs = 1
[inverter]
topology = "two_level"
vdc = 582
[control]
ts = 50e-6
k_psi = 10.0
psi_max = 1.5
current_max = 20.0
torque_max = 30.0
speed_max = 400.0
"""


def text_of(folder: Path) -> str:
    return plain_text((folder / "anpc5l_6kv.toml").stem)


def test_the_drives_that_ship(drive: Drive, verified_drive: Drive) -> None:
    assert drive.ts_pu == pytest.approx(0.015708, abs=1e-6)
    assert drive.bounds.tolist() == [0.1, 0.1, 0.1, 0.05, 0.08, 0.08, 0.08]
    assert drive.machine.d == pytest.approx(0.4628, abs=5e-5)
    assert drive.machine.tau_s == pytest.approx(18.1, abs=0.05)
    assert drive.machine.tau_r == pytest.approx(574, abs=0.5)
    assert drive.control.switching_horizon == "SE"
    assert isinstance(drive.machine, InductionMachine)
    assert verified_drive.base.voltage == pytest.approx(math.sqrt(2 / 3) * 3300, rel=1e-5)
    assert verified_drive.base.current == pytest.approx(math.sqrt(2) * 356, rel=1e-4)


def test_assumed_parameters_say_so(drives_folder: Path) -> None:
    assert "ASSUMED" in text_of(drives_folder)


def test_drives_are_frozen(drive: Drive) -> None:
    with pytest.raises(ValidationError):
        drive.control.horizon = 1
    with pytest.raises(AttributeError):
        drive.machine.rs = 1.0


def test_optional_key_and_integers_as_numbers(drives_folder: Path, tmp_path: Path) -> None:
    text = text_of(drives_folder)
    text = text.replace("vdc = 2.0", "vdc = 2").replace('"SE"   #', '"SESE"   #')
    path = tmp_path / "drive.toml"
    path.write_text(text)
    drive = load_mpdcc_drive(path)
    assert drive.inverter.vdc == 2.0
    assert drive.control.switching_horizon == "SESE"
    path.write_text(text.replace("switching_horizon", "# switching_horizon"))
    assert load_mpdcc_drive(path).control.switching_horizon == "SE"
    assert (drive.control.budget, drive.control.delay_compensation) == (0, False)
    assert drive.control.deadlock_rule == "largest"
    for rule in ("largest", "weighted"):
        path.write_text(text.replace("[control]", f'[control]\ndeadlock_rule = "{rule}"'))
        assert load_mpdcc_drive(path).control.deadlock_rule == rule
    path.write_text(text)
    # both stand with either horizon: a budget without SESE limits nothing
    for budget, delay in ((0, "false"), (1, "true"), (4095, "true")):
        for kind in (text, text_of(drives_folder)):
            more = f"[control]\nbudget = {budget}\ndelay_compensation = {delay}"
            path.write_text(kind.replace("[control]", more))
            control = load_mpdcc_drive(path).control
            assert (control.budget, control.delay_compensation) == (budget, delay == "true")


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("rs = 0.0057", "rs = 0.21", ["machine.rs", "0.21", "0.001 to 0.2"]),
        ("rs = 0.0057", "rs = 0.0009", ["machine.rs", "0.001 to 0.2"]),
        ("rs = 0.0057", "rs = nan", ["machine.rs", "nan", "0.001 to 0.2"]),
        ("rs = 0.0057", "rs = inf", ["machine.rs", "inf", "0.001 to 0.2"]),
        ("rs = 0.0057", 'rs = "0.0057"', ["machine.rs", '"0.0057"', "a number"]),
        ("rs = 0.0057", "rs = [0.0057]", ["machine.rs", "a number"]),
        ("rs = 0.0057", "", ["machine.rs", "missing", "0.001 to 0.2"]),
        ("rs = 0.0057", "rs = 0.0057\nRs = 0.0057", ["machine.Rs", "unknown", "rs, rr, xls"]),
        ("xm = 2.4915", "xm = true", ["machine.xm", "true", "a number"]),
        ("xm = 2.4915", f"xm = 1{'0' * 400}", ["machine.xm", "1 to 5"]),
        ("xm = 2.4915", f"xm = 1{'0' * 5000}", ["not a TOML file"]),
        ("vdc = 2.0", "vdc = 2.6", ["inverter.vdc", "1.5 to 2.5"]),
        ("xdc = 2.201", "xdc = 0.4", ["inverter.xdc", "0.5 to 10"]),
        ('"anpc5l"', '"npc5l"', ["inverter.topology", '"npc5l"', '"anpc5l"']),
        ("ts = 50e-6", "ts = 50", ["control.ts", "50", "1.91e-05 to 0.0002005"]),
        ("ts = 50e-6", "ts = 0.0", ["control.ts", "0.006 to 0.063"]),
        ("ts = 50e-6", "ts = nan", ["control.ts", "0.006 to 0.063"]),
        ("frequency = 50.0", "frequency = 500.0", ["control.ts", "500 Hz", "1.91e-06"]),
        ("frequency = 50.0", "frequency = 0", ["base.frequency", "1 to 1000 Hz"]),
        ("current = 139.9", "current = 139.9\nname = 1", ["base.name", "unknown", "frequency"]),
        ("horizon = 63 ", "horizon = 63.0 ", ["control.horizon", "63.0", "an integer from 1"]),
        ("horizon = 63 ", "horizon = 64 ", ["control.horizon", "64", "1 to 63"]),
        ("horizon = 63 ", "horizon = 0 ", ["control.horizon", "1 to 63"]),
        ("horizon = 63 ", "horizon = true ", ["control.horizon", "true", "an integer"]),
        ('"SE"   #', '"se"   #', ["control.switching_horizon", '"se"', '"SE" or "SESE"']),
        ('"SE"   #', "1   #", ["control.switching_horizon", '"SE" or "SESE"']),
        ("[control]", "[control]\nbudget = 4096", ["control.budget", "4096", "0 to 4095"]),
        ("[control]", "[control]\nbudget = -1", ["control.budget", "-1", "from 0 to 4095"]),
        ("[control]", "[control]\nbudget = 10.0", ["control.budget", "10.0", "an integer from 0"]),
        ("[control]", "[control]\nbudget = true", ["control.budget", "true", "an integer from 0"]),
        ("[control]", '[control]\nbudget = "9"', ["control.budget", '"9"', "an integer from 0"]),
        ("[control]", "[control]\nbudgets = 9", ["control.budgets", "unknown", "budget, delay_"]),
        ("[control]", f"[control]\n{DELAY} = 1", [f"control.{DELAY}", "got 1;", "true or false"]),
        ("[control]", f"[control]\n{DELAY} = 0", [f"control.{DELAY}", "got 0;", "true or false"]),
        ("[control]", f'[control]\n{DELAY} = "on"', [f"control.{DELAY}", '"on"', "true or false"]),
        ("[control]", '[control]\ndeadlock_rule = "least"', [RULE, '"least"', '"largest" or "we']),
        ("[control]", "[control]\ndeadlock_rule = 1", [RULE, "got 1;", '"largest" or "weighted"']),
        ("[base] ", f"{DELAY} = true\n[base] ", [DELAY, "unknown", "top level"]),
        ("[base] ", "budget = 9\n[base] ", ["budget", "unknown", "top level"]),
        ("lambda_n = 0.1", "lambda_n = -0.1", ["control.lambda_n", "0 to 100"]),
        ("bound_vn = 0.05", "bound_vn = 0.01", ["control.bound_vn", "0.02 to 0.5"]),
        ("[inverter] ", "[inverters] ", ["inverters", "unknown", "inverter: missing"]),
        ("[base] ", "[[base]] ", ["base", "a table [base]"]),
        ("[machine] ", "[[machine]] ", ["machine", "a table [machine]"]),
        ('controller = "mpdcc"', 'controller = "dtc"', ["controller", '"dtc"', '"mpdcc"']),
        ('controller = "mpdcc"', "controller = 1", ["controller", '"mpdcc", "mptc" or "kbest"']),
        ('controller = "mpdcc"', "", ["controller", "missing", '"mpdcc", "mptc" or "kbest"']),
        ('controller = "mpdcc"', 'controller = "mptc"', ["base", "unknown"]),
        ("rs = 0.0057", "rs = ", ["not a TOML file", "line 17"]),
        ("rs = 0.0057", "rs = 0.0057\nrs = 0.0057", ["not a TOML file"]),
    ],
)
def test_bad_files(
    drives_folder: Path, tmp_path: Path, old: str, new: str, named: list[str]
) -> None:
    text = text_of(drives_folder)
    assert text.count(old) == 1
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(DriveFileError) as caught:
        load_mpdcc_drive(path)
    message = str(caught.value)
    assert "\n" not in message
    for part in [str(path), *named]:
        assert part in message


def test_a_byte_order_mark_is_no_key(drives_folder: Path, tmp_path: Path) -> None:
    text = (drives_folder / "anpc5l_6kv.toml").read_text(encoding="utf-8")
    path = tmp_path / "drive.toml"
    path.write_text(text, encoding="utf-8-sig")
    assert load_mpdcc_drive(path) == load_mpdcc_drive(drives_folder / "anpc5l_6kv.toml")


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(DriveFileError, match=r"none\.toml: cannot be read"):
        load_mpdcc_drive(tmp_path / "none.toml")
    with pytest.raises(DriveFileError, match="cannot be read"):
        load_mpdcc_drive(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DriveFileError, match="not a TOML file"):
        load_mpdcc_drive(binary)
    empty = tmp_path / "empty.toml"
    empty.write_text("")
    with pytest.raises(DriveFileError, match="controller: missing"):
        load_mpdcc_drive(empty)


def test_mptc_drives(tmp_path: Path, drives_folder: Path) -> None:
    path = tmp_path / "mptc.toml"
    path.write_text(MPTC)
    drive = load_drive(path)
    assert isinstance(drive, MptcDrive)
    assert drive == load_mptc_drive(path)
    assert (drive.control.method, drive.inverter.vdc) == ("MPTC", 582.0)
    path.write_text(MPTC + 'method = "MPFC"\n')
    assert load_mptc_drive(path).control.method == "MPFC"
    with pytest.raises(DriveFileError, match='must be "mpdcc"'):
        load_mpdcc_drive(path)
    with pytest.raises(DriveFileError, match='must be "mptc"'):
        load_mptc_drive(drives_folder / "anpc5l_6kv.toml")


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("ls = 0.175", "ls = 0.165", ["machine.lm", "got 0.17;", "below 0.1699265 H", "ls*lr"]),
        ("lr = 0.175", "lr = 0.1", ["machine.lm", "below 0.1322876 H"]),
        ("ls = 0.175\nlr = 0.175", "ls = 0.17\nlr = 0.17", ["machine.lm", "below 0.17 H"]),
        ("pole_pairs = 1", "pole_pairs = 1.0", ["machine.pole_pairs", "an integer from 1"]),
        ("psi_max = 1.5", "", ["control.psi_max", "missing"]),
        ('"two_level"', '"anpc5l"', ["inverter.topology", '"two_level"']),
        (
            "ts = 50e-6",
            "ts = 50e-6\nbudget = 1",
            ["control.budget", "unknown", "[control] may hold"],
        ),
        ("ts = 50e-6", f"ts = 50e-6\n{DELAY} = true", [f"control.{DELAY}", "unknown", "method"]),
        ("speed_max = 400.0", 'method = "FOC"\nspeed_max = 4', ["control.method", '"MPFC"']),
    ],
)
def test_bad_mptc_files(tmp_path: Path, old: str, new: str, named: list[str]) -> None:
    assert MPTC.count(old) == 1
    path = tmp_path / "bad.toml"
    path.write_text(MPTC.replace(old, new))
    with pytest.raises(DriveFileError) as caught:
        load_mptc_drive(path)
    for part in [str(path), *named]:
        assert part in str(caught.value)


def test_bounds_are_a_fresh_array(drive: Drive) -> None:
    drive.bounds[0] = np.nan
    assert drive.bounds[0] == 0.1


@pytest.mark.parametrize(
    ("ls", "lm", "lr"),
    [(0.245, 0.224, 0.224), (0.17, 0.17, 0.175), (0.245, 0.448, 0.896), (0.245, 0.112, 0.056)],
)
def test_any_turns_ratio_is_a_machine(tmp_path: Path, ls: float, lm: float, lr: float) -> None:
    path = tmp_path / "drive.toml"
    text = MPTC.replace("ls = 0.175", f"ls = {ls}").replace("lr = 0.175", f"lr = {lr}")
    path.write_text(text.replace("lm = 0.170", f"lm = {lm}"))
    machine = load_mptc_drive(path).machine
    assert (machine.ls, machine.lm, machine.lr) == (ls, lm, lr)


def test_changed_values_are_checked_as_a_files(drive: Drive, drives_folder: Path) -> None:
    other = drive.changed(machine={"rs": 0.006}, control={"horizon": np.int64(20)})
    assert (other.machine.rs, other.control.horizon) == (0.006, 20)
    assert isinstance(other.machine, InductionMachine)
    assert (drive.machine.rs, drive.control.horizon) == (0.0057, 63)
    assert other.machine.xm == drive.machine.xm
    mptc = load_mptc_drive(drives_folder / "induction_2kw2.toml")
    assert mptc.with_control(method="MPFC").control.method == "MPFC"
    for change, message in (
        (lambda: drive.with_control(horizon=64), "control.horizon: got 64; .*from 1 to 63"),
        (lambda: drive.with_control(horizons=6), "control.horizons: unknown key; .control. may"),
        (lambda: drive.with_control(ts=300e-6), "control.ts: got 0.0003 s; .*0.0002005 s"),
        (lambda: drive.changed(base={"frequency": 400.0}), "control.ts: .*= 400 Hz"),
        (lambda: drive.changed(motor={"rs": 1.0}), "motor: unknown key"),
        (lambda: drive.changed(machine=3), "machine: got 3; a table of keys"),
        (lambda: mptc.changed(machine={"lr": 0.1}), "machine.lm: got 0.221; .*below 0.151657"),
        (lambda: mptc.with_control(method="FOC"), 'control.method: got "FOC"; .*"MPFC"'),
    ):
        with pytest.raises(DriveError, match=message):
            change()


def test_a_drive_that_ships_is_found_by_its_name(
    drives_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {path.stem: path.read_text(encoding="utf-8") for path in drives_folder.glob("*.toml")}
    assert shipped_drives() == files
    monkeypatch.chdir(tmp_path)
    for name in files:
        assert load_drive(name) == load_drive(drives_folder / f"{name}.toml")
        assert load_drive(f"{name}.toml") == load_drive(name)
    with pytest.raises(DriveFileError, match=r"nothing: cannot be read.*anpc5l_6kv"):
        load_drive("nothing")
    Path("anpc5l_6kv.toml").write_text(MPTC)  # a file of the user's comes first
    assert isinstance(load_drive("anpc5l_6kv.toml"), MptcDrive)
    assert isinstance(load_drive("anpc5l_6kv"), Drive)


IN_SI = {
    "voltage = 2694.44": 'voltage = "2.69444 kV"', "current = 503.46": 'current = "503.46 A"',
    "frequency = 50.0": 'frequency = "50 Hz"', "rs = 0.0108": 'rs = "57.8 mohm"',
    "xls = 0.1493": 'xls = "2.5434mH"', "xm = 2.3489": 'xm = "12.571 ohm"',
    "vdc = 1.930": 'vdc = "5200 V"', "xdc = 5.0": 'xdc = "2.974 mF"', "ts = 50e-6": 'ts = "50 us"',
    "current_limit = 1.8": 'current_limit = "906.2 A"',
    "speed_limit = 1.2": 'speed_limit = "60 Hz"', "bound_vn = 0.08": 'bound_vn = "215.6 V"',
}  # fmt: skip


def test_a_file_may_have_values_with_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, path = shipped_drives()["npc3l_3kv3"], tmp_path / "si.toml"
    for value, other in IN_SI.items():
        assert text.count(value) == 1, value
        text = text.replace(value, other)
    path.write_text(text, encoding="utf-8")
    wanted, found = load_drive("npc3l_3kv3"), load_drive(path)
    assert drive_info.cli.main([str(path), "--file"]) == 0
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    for drive, other, near in ((wanted, found, 1e-3), (found, load_drive(path), 1e-7)):
        for table in ("base", "machine", "inverter", "guard", "control"):
            for key in keys_of(type(getattr(wanted, table))):
                value = getattr(getattr(drive, table), key)
                same = pytest.approx(value, rel=near) if isinstance(value, float) else value
                assert getattr(getattr(other, table), key) == same, key


@pytest.mark.parametrize(
    ("value", "other", "said"),
    [
        ("vdc = 1.930", 'vdc = "5.2 kA"', 'inverter.vdc: got "5.2 kA"; it must be a number, or'),
        ("rs = 0.0108", 'rs = "57.8"', "machine.rs: got .* ohm, with M, k, m or u before it"),
        ("rs = 0.0108", 'rs = "1.2.3 ohm"', "machine.rs"),
        ("voltage = 2694.44", 'voltage = "2.7 kHz"', "base.voltage: got .* V, with"),
        ("vdc = 1.930", 'vdc = "52 kV"', 'inverter.vdc: got "52 kV"; .* 1.5 to 2.5 pu, or from "4'),
        ("vdc = 1.930", "vdc = 5200", '5200; .* 2.5 pu, or from "4.042 kV" to "6.736 kV"$'),
        (
            "link_high = 2.4125",
            'link_high = "9 MV"',
            'guard.link_high: got "9 MV"; .* to "11.03 kV"$',
        ),
        ("rs = 0.0108", "rs = 57.8", 'machine.rs: got 57.8; .* "5.352 mohm" to "1.07 ohm"$'),
    ],
)
def test_a_unit_that_is_wrong(value: str, other: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "si.toml"
    path.write_text(shipped_drives()["npc3l_3kv3"].replace(value, other), encoding="utf-8")
    with pytest.raises(DriveFileError, match=said):
        load_drive(path)


@pytest.mark.parametrize("name", ["anpc5l_6kv", "npc3l_3kv3"])
def test_the_ends_of_a_range_with_units_are_inside_it(name: str) -> None:
    drive, ends = load_drive(name), 0
    tables = tomllib.loads(shipped_drives()[name])
    for table in ("machine", "inverter", "guard", "control"):
        for key in keys_of(type(getattr(drive, table))):
            with pytest.raises(DriveError) as error:
                drive.changed(**{table: {key: 1e300}})
            said = re.search(
                rf"{table}.{key}: got .* from (.+) to (.+) pu, or (.*)", str(error.value)
            )
            for end in re.findall('"(.*?)"', said[3]) if said else ():
                one = per_unit(tables | {table: {key: end}})[table][key]
                assert float(said[1]) <= one <= float(said[2]), f"{key} = {end}"
                ends += 1
    assert ends >= 20
