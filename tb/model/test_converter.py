"""Files of converters: what they say, and that a slip in one is found.

Sweep: every converter that ships; typing errors in each of them, in every kind of entry.
Checks: the error of a slip names file and entry; what is derived from the circuit; weights of a
file's own; a file elsewhere is read as well.
Does not prove: that a table without contradictions is the converter meant.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from directmpc import converter
from directmpc.converter import ConverterError
from scripts.shared.tools import ROOT

FOLDER = ROOT / "converters"

#: Converter, text of its file, the slip, what the message begins with behind the file's name.
SLIPS = [
    ("anpc5l", "gates = [2, 4, 6, 8]", "gates = [2, 4, 6, 7]", "positions[1].gates: [2, 4, 6, 7]"),
    ("anpc5l", "v_ph =  1, charge = -1, next = [0,", "v_ph = -1, charge =  1, next = [0,",
     "positions[1]: got v_dc = -0.5, v_n = 0, v_ph = -1; its gates [2, 4, 6, 8] make"),
    ("anpc5l", "charge = -1, next = [0, 1, 3]", "charge =  1, next = [0, 1, 3]",
     "positions[1].charge: got 1; with v_ph = 1 it is -1"),
    ("anpc5l", "next = [0, 1, 3]", "next = [0, 1, 4]", "positions[1].next: 4 may follow 1, but"),
    ("anpc5l", "next = [0, 1, 3]", "next = [0, 3]", "positions[1].next: got [0, 3]; 1 itself"),
    ("anpc5l", "{ on = [4], change = -4 }", "{ on = [4], change = -3 }", "stop.rules[1].change"),
    ("anpc5l", "{ on = [2], off = [8], change = 8 }", "{ on = [2], off = [7], change = 7 }",
     "stop.rules: a stop from"),
    ("anpc5l", 'nodes = ["A", "p"], rating = 0.25', 'nodes = ["p", "A"], rating = 0.25',
     "positions[0].gates"),
    ("anpc5l", "rating = 0.25", "rating = 2.5", "switches.S5.rating: got 2.5"),
    ("anpc5l", "share = 0.25", "share = 0.3", "capacitor.share: got 0.3"),
    ("anpc5l", "groups = [[5, 6, 7, 8]", "groups = [[5, 6, 7, 7]", "start.groups[0]"),
    ("anpc5l", "S5 =", "S9 =", "switches.S9"),
    ("anpc5l", "first = [1, 4]", "first = [1, 4, 5]", "stop.first"),
    ("npc3l", "gates = [2, 3], v_dc =  0.0", "gates = [2, 4], v_dc =  0.0", "positions[1].gates"),
    ("npc3l", "v_n = 1", "v_n = 0", "positions[1]: got v_dc = 0, v_n = 0"),
    ("npc3l", 'nodes = ["B", "M"]', 'nodes = ["M", "B"]', "positions[0].gates"),
    ("npc3l", "next = [0, 1, 2]", "next = [0, 1]", "positions[2].next: 1 may follow 2, but"),
    ("npc3l", "next = [0, 1] }", "next = [0, 1, 2] }", "positions[0].next: 2 may follow 0, but"),
    ("npc3l", "through = 1", "through = 0", "start.through"),
    ("ttype3l", 'nodes = ["O", "X"]', 'nodes = ["X", "O"]', "positions[2].gates"),
    ("ttype3l", 'nodes = ["M", "X"]', 'nodes = ["M", "Y"]', 'switches.S2.nodes: nothing else is'),
    ("ttype3l", "v_dc =  0.5", "v_dc =  0.4", "positions[2].v_dc: got 0.4"),
    ("ttype3l", 'neutral = "M"', 'neutral = "P"', "neutral: got 'P'"),
    ("fc3l", "gates = [2, 4]", "gates = [2, 3]", "positions[1].gates: [2, 3]"),
    ("fc3l", "share = 0.5", "share = 0.25", "positions[0]"),
    ("fc3l", "v_ph = -1, charge =  1", "v_ph = -1, charge =  2", "positions[2].charge: got 2"),
    ("fc3l", "next = [0, 2, 3]", "next = [0, 2, 4]", "positions[2].next[2]: got 4"),
    ("fc3l", 'positive = "p"', 'positive = "r"', 'capacitor: got "r"'),
    ("two_level", "gates = [1]", "gates = [1, 2]", "positions[1].gates: [1, 2]"),
    ("two_level", "v_dc =  0.5", "v_dc = -0.5", "positions[1]: got v_dc = -0.5"),
    ("two_level", 'output = "O"', 'output = "P"', 'output: got "P"'),
    ("two_level", "title =", "tilte =", "tilte: unknown key"),
    ("two_level", "rules = []", "", "stop.rules: missing"),
    ("two_level", "rails = { P = 0.5", "rails = { P = 0.4", "rails: one node at 0.5"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "slip", "message"), SLIPS)
def test_a_slip_is_found(name: str, text: str, slip: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / f"{name}.toml"
    whole = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    assert text in whole
    file.write_text(whole.replace(text, slip, 1), encoding="utf-8")
    with pytest.raises(ConverterError) as found:
        converter.read_converter(file)
    assert str(found.value).startswith(f"{file}: {message}"), str(found.value)


def test_every_converter_has_a_slip() -> None:
    assert {slip[0] for slip in SLIPS} == set(converter.shipped())
    assert set(converter.shipped()) == {path.stem for path in FOLDER.glob("*.toml")}


def test_a_graph_in_two_parts_is_found(tmp_path: Path) -> None:
    whole = (FOLDER / "fc3l.toml").read_text(encoding="utf-8")
    for old, new in (
        ("[0, 1, 2]", "[0, 1]"), ("[0, 1, 3]", "[0, 1]"),
        ("[0, 2, 3]", "[2, 3]"), ("[1, 2, 3]", "[2, 3]"),
    ):  # fmt: skip
        whole = whole.replace(f"next = {old}", f"next = {new}")
    file = tmp_path / "parted.toml"
    file.write_text(whole, encoding="utf-8")
    with pytest.raises(ConverterError, match=r"positions\[2\]\.next: position 2 cannot be reached"):
        converter.read_converter(file)


def test_weights_of_a_file_depend_on_the_sign_of_the_current(tmp_path: Path) -> None:
    whole = (FOLDER / "npc3l.toml").read_text(encoding="utf-8")
    given = "next = [0, 1, 2], weights = [1, 0, 2], weights_negative = [2, 0, 1] }"
    file = tmp_path / "own.toml"
    file.write_text(whole.replace("next = [0, 1, 2] }", given), encoding="utf-8")
    leg = converter.read_converter(file)
    assert leg.transition_weight[:, 1].tolist() == [[1, 0, 2], [2, 0, 1]]
    assert leg.transition_weight[:, 0].tolist() == [[0, 1, -1]] * 2
    file.write_text(whole.replace("next = [0, 1, 2] }", given.replace("0, 2]", "1, 2]")))
    with pytest.raises(ConverterError, match=r"positions\[1\]\.weights\[1\]: got 1; .* 0 to 0"):
        converter.read_converter(file)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    file = tmp_path / "none.toml"
    with pytest.raises(ConverterError, match=r"none\.toml: cannot be read"):
        converter.read_converter(file)
    file.write_text("title = ", encoding="utf-8")
    with pytest.raises(ConverterError, match=r"none\.toml: not a TOML file"):
        converter.read_converter(file)
    with pytest.raises(ConverterError, match='got "npc"; it must be one of anpc5l, fc3l, npc3l'):
        converter.load("npc")


OWN = FOLDER.parent / "examples" / "converters"


def test_the_worked_example_is_sound() -> None:
    leg = converter.read_converter(OWN / "anpc3l.toml")
    assert leg.positions == 4
    assert leg.is_forbidden({1, 5})
    assert leg.is_forbidden({4, 6})
    assert leg.commutation(1, 2) == (2, -6, 5, -3)
    text = (OWN / "anpc3l.toml").read_text(encoding="utf-8")
    wrong = text.replace("gates = [1, 2, 6]", "gates = [1, 2, 5]")
    with pytest.raises(ConverterError) as caught:
        converter._parsed("anpc3l.toml", "anpc3l", wrong)
    page = (FOLDER.parent / "docs" / "converters.md").read_text(encoding="utf-8")
    assert f"`{caught.value}`" in page.replace("\n", " ")


def own(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command with converters of one's own."""
    environment = os.environ | {converter.FOLDER: str(folder)}
    return subprocess.run(
        [sys.executable, "-m", "scripts", *arguments], cwd=FOLDER.parent, env=environment,
        capture_output=True, text=True, timeout=900, check=False,
    )  # fmt: skip


@pytest.mark.thorough
def test_the_worked_example_runs_on_its_core(tmp_path: Path) -> None:
    drive = OWN.parent / "anpc3l_3kv3.toml"
    out = ("--out", str(tmp_path / "run.png"), "--trace", str(tmp_path / "run.csv"))
    done = own(OWN, "run", "--drive", str(drive), "--steps", "60", *out)
    assert done.returncode == 0, done.stderr
    assert "60 checked" in done.stdout
    assert "0 differ" in done.stdout


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (None, "no folder with files of converters"),
        ("npc3l.toml", "npc3l ships with directmpc; take another name"),
        ("own.toml", "own.toml: title: missing"),
    ],
)
def test_a_folder_of_one_s_own_that_is_wrong(file: str | None, said: str, tmp_path: Path) -> None:
    if file:
        (tmp_path / file).write_text("", encoding="utf-8")
    done = own(tmp_path, "run", "--help")
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("name", converter.shipped())
def test_weights_are_turn_ons_and_levels_span_the_link(name: str) -> None:
    leg = converter.load(name)
    assert np.array_equal(leg.transition_weight, [leg.turn_ons()] * 2)
    assert (leg.level[0], leg.level[-1]) == (-2, 2)
    assert leg.next_table.shape == (leg.positions, converter.MAX_NEXT)
    for s, following in enumerate(leg.next_positions):
        assert tuple(leg.next_table[s, : leg.next_count[s]]) == following


def test_devices() -> None:
    found = {
        name: (converter.load(name).logical_devices, converter.load(name).physical_devices)
        for name in converter.shipped()
    }
    assert found == {
        "anpc5l": (24, 36), "fc3l": (12, 12), "npc3l": (12, 12), "ttype3l": (12, 12),
        "two_level": (6, 6),
    }  # fmt: skip
