"""A question for the kind of a drive that is added turns `make lint` red; one that goes, too.

Stimulus: a library of one file with one question, of each form, and with one more or less.
Does not prove: that what asks by a name of its own (`five`) is no question.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.measure import checks

QUESTIONS = (
    "isinstance(drive, MptcDrive)", "isinstance(x, int | mpdcc.Drive)", "issubclass(x, Drive)",
    'drive.controller == "mptc"', '"kbest" != name', 'name in ("mpdcc", "other")',
)  # fmt: skip
OTHERS = ("isinstance(drive, Mapping)", 'DRIVES["mpdcc"]', 'name == "other"', "kind.per_unit")


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_question_more_or_less_is_said(
    question: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks, "ROOT", tmp_path)
    monkeypatch.setattr(checks, "KIND_QUESTIONS", {"model": 1})
    file = tmp_path / "model" / "one.py"
    file.parent.mkdir()
    for asked, said in ((0, "can fall"), (1, ""), (2, "2; at most 1")):
        lines = [*OTHERS, *[question] * asked]
        file.write_text("\n".join(lines), encoding="utf-8")
        found = checks.kind_questions()
        assert len(found) == (0, 0, 3)[asked] + (asked == 0)
        assert said in " ".join(found)
    assert found[0] == "model/one.py:5: asks for the kind"
