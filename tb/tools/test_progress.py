"""What a tool shows while it works: counts from several threads, what is under way, times.

Stimulus: counters of 0 and 40, threads that count; stderr that is no terminal.
Does not prove: how bars look on a terminal.
"""

from __future__ import annotations

import io
import re
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from directmpc.host import console
from scripts.shared import progress


def test_every_count_of_several_threads_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.counter("things", 40) as advance, ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: advance(), range(40)))
    shown = capsys.readouterr()
    assert shown.out == ""
    lines = shown.err.splitlines()
    assert lines == [f"things: {n} of 40" for n in range(0, 41, 4)]


def test_silence_is_broken(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console, "_PULSES_S", (0.15, 0.3))
    with progress.busy("a long step"):
        time.sleep(0.6)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "a long step ..."
    # after 0.15 s and 0.3 s more; a loaded machine may be late
    assert 1 <= len(lines[1:]) <= 2
    assert all(re.fullmatch(r"a long step \.\.\., \d+ s", line) for line in lines[1:])
    with progress.counter("things", 2) as advance:
        for _ in range(2):
            time.sleep(0.25)
            advance()
    lines = capsys.readouterr().err.splitlines()
    counts = [line for line in lines if re.fullmatch(r"things: \d of 2", line)]
    assert counts == [f"things: {n} of 2" for n in range(3)]
    assert "things: 0 of 2, 0 s" in lines


def test_what_is_heard_is_not_said_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "_PULSES_S", (1.0,))
    out = io.StringIO()
    with console.Pulse(lambda: "silent", out) as pulse:
        for _ in range(14):
            time.sleep(0.1)
            pulse.heard()
    assert out.getvalue() == ""


def test_nothing_to_do_shows_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.counter("things", 0) as advance:
        advance()
    assert capsys.readouterr() == ("", "")


def test_what_is_under_way_and_since_when_is_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    say = progress.teller("tool")
    with progress.busy("a long step"):
        say("[half] of it")
    shown = capsys.readouterr()
    assert shown.out == ""
    first, second = shown.err.splitlines()
    assert first == "a long step ..."
    assert re.fullmatch(r"tool, +\d+ s: \[half\] of it", second)
