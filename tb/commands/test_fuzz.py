"""`make fuzz`: bytes that nobody meant, for the parsers of drive files, traces, decisions, frames.

Stimulus: some hundred changed examples for each parser; a parser with a fault; bytes that were
findings before.
Checks: parsers refuse with their own error or accept; a fault is found and ends with 1; the
examples themselves are accepted.
Does not prove: what more time would find.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.host import protocol as p
from scripts.commands.fuzz import cli
from scripts.studies import fuzz

RUNS = {"drive file": 150, "trace of MPDCC": 60, "trace of MPTC": 60, "decisions": 100}


@pytest.mark.parametrize("name", fuzz.TARGETS)
def test_a_parser_refuses_or_accepts(name: str, tmp_path: Path) -> None:
    target = fuzz.TARGETS[name]
    for example in target.examples():
        target.read(example, tmp_path)  # a well-formed one is not refused
    found = list(fuzz.run(name, 60, 1, RUNS.get(name, 400)))
    assert len(found) >= 20
    assert [one for one in found if one is not None] == []


def test_a_fault_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # a judge that leaves out the CRC
    judge = p.judge

    def _careless(stuffed: bytes) -> tuple[p.Outcome, p.Frame | None]:
        outcome, frame = judge(stuffed)
        if outcome is p.Outcome.CRC:
            body = p.unstuff(stuffed)
            return p.Outcome.ACCEPTED, p.Frame(body[0], int.from_bytes(body[2:6], "little"))
        return outcome, frame

    monkeypatch.setattr(p, "judge", _careless)
    arguments = ["frames", "--minutes", "0.2", "--out", str(tmp_path)]
    assert cli.main(arguments) == 1
    assert "frames-0" in capsys.readouterr().err
    assert (tmp_path / "frames-0").read_bytes()


def test_replies_of_another_length_are_refused() -> None:
    # what the fuzzer found: the error was that of struct
    for unpack, size in ((p.Identity.unpack, 16), (p.Decision.unpack, 12)):
        for length in (0, size - 1, size + 1):
            with pytest.raises(p.ProtocolError, match=f"{length} bytes; it has {size}"):
                unpack(bytes(length))
    with pytest.raises(p.ProtocolError, match="controller 255"):
        p.Identity.unpack(b"\1\xff" + bytes(14))


def test_a_target_that_is_not_there_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["bitstreams"])
    assert "there are: drive file" in capsys.readouterr().err
