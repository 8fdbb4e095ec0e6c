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
from directmpc.api.drive_file import load_drive
from directmpc.drive_tables import keys_of
from directmpc.host import registers
from scripts.commands import new_drive
from scripts.generate import drive_template
from scripts.hdl import states
from scripts.shared.tools import ROOT

SPECIFICATION = ROOT / "docs" / "specification.md"
CONTROLLERS = ("mpdcc", "mptc")
#: End of a key's comment by its default in the specification.
RULES = {
    "required": "Required.",
    "to start": "Required to start the drive.",
    "from `control.ts": "Without it: from control.ts.",
}


def specified(controller: str) -> dict[str, tuple[str, str]]:
    """Keys of a drive file as the specification's table has them: range and default."""
    text = SPECIFICATION.read_text(encoding="utf-8")
    part = re.search(rf"<!-- keys of {controller}: begin.*?-->\n(.*?)<!--", text, re.S)
    assert part
    rows = [line.split("|") for line in part.group(1).splitlines()[2:]]
    return {row[1].strip(" `"): (row[3], row[4].strip(" `")) for row in rows}


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
    assert new_drive.COMMAND.main([controller, str(path)]) == 0
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
        assert new_drive.COMMAND.main(["mpdcc", str(path)]) == 2
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
