"""A new drive file: every key with its comment, what the studies recommend, nothing replaced.

Stimulus: both controllers; a name that is taken, a folder that does not exist, a link to nothing.
Checks: the file has every key of docs/specification.md's tables, each under a comment that has its
range and its default; docs/drive-file.md names each setting; the file loads, gives registers, runs
in the bit-true model, and is another one's drive but for what is recommended; a file that is there
stays as it is. A template that lacks a key is seen.
Does not prove: that the values suit a user's drive.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from directmpc import simulate
from directmpc.api.data_sheet import doubts
from directmpc.api.drive_file import load_drive
from directmpc.api.nameplate import Nameplate, estimate
from directmpc.drive_tables import keys_of
from directmpc.host import registers
from directmpc.loads import InductionMachine
from scripts.commands import new_drive
from scripts.generate import drive_template
from scripts.hdl import states
from scripts.shared.tools import ROOT

SPECIFICATION = ROOT / "docs" / "specification.md"
CONTROLLERS = ("mpdcc", "mptc")
#: End of a key's comment by its default in the specification.
RULES = {
    "to turn": "Required for a speed controller.",
    "": "Required.",
    "to start": "Required to start the drive.",
    "from `control.ts": "Without it: from control.ts.",
}


def specified(controller: str) -> dict[str, tuple[str, str]]:
    """Keys of a drive file as the specification's tables have them: range and default."""
    text = SPECIFICATION.read_text(encoding="utf-8")
    found = {}
    for name in (controller, "guard"):
        part = re.search(rf"<!-- keys of {name}: begin.*?-->\n(.*?)<!--", text, re.S)
        assert part
        rows = [line.split("|") for line in part.group(1).splitlines()[2:]]
        found |= {row[1].split("`")[1]: (row[2], row[3].strip(" `")) for row in rows}
    return found


def keys_in(text: str) -> dict[str, tuple[str, Any]]:
    """Keys of a template: the comment above each, and its value."""
    values, found, table, comment = tomllib.loads(text), {}, "", ""
    for line in text.splitlines():
        if line.endswith(" ="):  # left to its default
            found[f"{table}.{line[2:-2]}"] = comment, None
            comment = ""
        elif line.startswith("#"):
            comment += f" {line[2:]}"
        elif line.startswith("["):
            table = line.strip("[]")
        elif line:
            name = line.partition(" = ")[0]
            where = values[table] if table else values
            found[f"{table}.{name}" if table else name] = comment, where[name]
        if not line.startswith("#"):
            comment = ""
    return found


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_key_is_there_with_its_range_and_default(controller: str) -> None:
    keys, wanted = keys_in(drive_template.template(controller)), specified(controller)
    assert set(keys) == set(wanted)
    assert len(keys) > 15
    numbers = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")
    for key, (allowed, default) in wanted.items():
        comment, _ = keys[key]
        shown = {float(number) for number in numbers.findall(comment)}
        for choice in re.findall(r'`("?\w+"?)`', allowed):
            assert choice in comment, key
        if "`" not in allowed:
            assert {float(number) for number in numbers.findall(allowed)} <= shown, key
        rule = RULES.get(default, f"Without it: {default}.")
        assert comment.endswith(rule), key


def test_a_key_without_a_meaning_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    meanings = dict(drive_template.MEANINGS["mpdcc"])
    del meanings["control.budget"]
    monkeypatch.setitem(drive_template.MEANINGS, "mpdcc", meanings)
    with pytest.raises(KeyError, match="budget"):
        drive_template.template("mpdcc")


def test_the_keys_of_the_page_are_there() -> None:
    page = (ROOT / "docs" / "drive-file.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`\w[^|]*`) \|", page, re.M)
    named = [key.rpartition(".")[2] for cell in cells for key in re.findall(r"`([^`]+)`", cell)]
    assert len(named) > 15
    keys = {key.rpartition(".")[2] for key in keys_in(drive_template.template("mpdcc"))}
    assert set(named) <= keys
    assert set(drive_template.RECOMMENDED["mpdcc"]) <= set(named)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_file_loads_and_runs(
    controller: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    assert new_drive.cli.main([controller, str(path)]) == 0
    assert str(path) in capsys.readouterr().out
    drive = load_drive(path)
    example = load_drive(drive_template.EXAMPLES[controller])
    for table in keys_of(type(drive)):
        one, other = getattr(drive, table), getattr(example, table)
        for key in keys_of(type(one)):
            wanted = getattr(other, key)
            if isinstance(wanted, float):
                wanted = pytest.approx(wanted, rel=1e-4)
            assert getattr(one, key) == wanted, f"{table}.{key}"
    found = registers.values(drive)
    assert found.saturated == []
    registers.refuse_slow(drive, found)
    result = simulate(drive, "model", steps=20)
    assert len(result.decisions) == 20
    assert not result.decisions.saturated.any()
    if controller == "mpdcc":
        # with a second level, too, and still in time on one explorer
        sese = drive.with_control(switching_horizon="SESE", delay_compensation=True)
        found = registers.values(sese)
        registers.refuse_slow(sese, found)


def test_nothing_is_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "there.toml"
    there.write_text("mine", encoding="utf-8")
    link = tmp_path / "link.toml"
    link.symlink_to(tmp_path / "nothing.toml")
    for path, words in (
        (there, "exists and stays as it is"),
        (link, "exists and stays as it is"),
        (tmp_path, "exists and stays as it is"),
        (tmp_path / "no" / "drive.toml", "there is no folder"),
        (there / "drive.toml", "there is no folder"),
    ):
        assert new_drive.cli.main(["mpdcc", str(path)]) == 2
        complaints = capsys.readouterr().err
        assert complaints.startswith(f"new-drive: {path}: {words}")
        assert complaints.count("\n") == 1
    assert there.read_text(encoding="utf-8") == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.toml", "there.toml"]


@pytest.mark.parametrize("name", states.SHIPPED)
def test_the_shipped_drives_have_what_is_recommended(name: str) -> None:
    control = load_drive(name).control
    defaults = keys_of(type(control))
    for key in drive_template.RECOMMENDED["mpdcc"]:
        assert getattr(control, key) != defaults[key].default, key
    assert states.shipped(name).control.deadlock_rule == defaults["deadlock_rule"].default


PLATE = "power=4,voltage=400,current=8.2,cos_phi=0.81,speed=1440,breakdown=2.8"


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_name_plate_gives_a_drive(
    controller: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plate.toml"
    assert new_drive.cli.main([controller, str(path), "--nameplate", PLATE]) == 0
    out = capsys.readouterr().out
    for text in (out, path.read_text(encoding="utf-8").replace("\n# ", " ")):
        assert "ESTIMATE" in text
        assert "torque (N m) 26.53 and 26.53, breakdown torque over rated 2.8 and 2.8" in text
    drive = load_drive(path)
    assert doubts(drive) == []
    if controller == "mptc":
        assert drive.machine.pole_pairs == 2
        # the known preset of such a machine has 1.405 and 1.395 ohm, 172.2 mH, 5.839 mH
        assert drive.machine.rs == pytest.approx(1.405, rel=0.2)
        assert drive.machine.lm == pytest.approx(0.1722, rel=0.2)
        result = simulate(drive, steps=2000, torque=26.5, speed=290.0, flux=1.0)
        assert result.torque.mean() == pytest.approx(26.5, rel=0.02)
    else:
        assert drive.base.voltage == pytest.approx(400 * (2 / 3) ** 0.5, rel=1e-3)


def test_an_estimate_finds_the_machine_that_made_the_plate() -> None:
    known = InductionMachine(rs=0.03, rr=0.02, xls=0.09, xlr=0.09, xm=2.2)
    point = known.steady_state(1.0, current=1.0, voltage=1.0)
    turning = (point.v_s * point.i_s.conjugate()).real
    shaft = point.torque * point.omega_r
    volts, amperes = 400.0, 20.0
    power = 3.0**0.5 * volts * amperes
    plate = Nameplate(
        power=power * shaft, voltage=volts, current=amperes, cos_phi=turning,
        speed=1500.0 * point.omega_r, breakdown=known.breakdown_torque() / point.torque,
    )  # fmt: skip
    found = estimate(plate, copper_share=1.0)
    for name in ("rs", "rr", "xls", "xlr", "xm"):
        assert getattr(found.machine, name) == pytest.approx(getattr(known, name), rel=1e-3), name
    for one, other in found.residuals.values():
        assert one == pytest.approx(other, rel=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("speed=1440", "speed=1200", "speed: got 1200 r/min; that is a slip of 20 %"),
        ("power=4", "power=4000", "power: got 4e+06 W; with voltage, current and cos_phi"),
        ("cos_phi=0.81", "cos_phi=81", "cos_phi: got 81; it must be a number from 0.3 to 0.99"),
        (",breakdown=2.8", "", "breakdown: missing; a plate needs power"),
        ("current", "amps", "got 'amps'; it may hold power"),
        ("current=8.2", "current=x", "current: got 'x'; it must be a number"),
        ("current=8.2", "current=8.2,current=8", "current: given twice"),
    ],
)
def test_an_impossible_plate_is_refused(
    old: str, new: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plate.toml"
    assert PLATE.count(old) == 1
    given = ["mptc", str(path), "--nameplate", PLATE.replace(old, new)]
    with pytest.raises(SystemExit) as ended:
        new_drive.cli.main(given)
    assert ended.value.code == 2
    assert f"argument --nameplate: {said}" in capsys.readouterr().err
    assert not path.exists()
