"""What a tool shows while it works: counts from several threads, what is under way, times.

Stimulus: counters of 0 and 40, threads that count; stderr that is no terminal.
Does not prove: how bars look on a terminal.
"""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor

import pytest

from scripts.shared import progress


def test_every_count_of_several_threads_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.counter("things", 40) as advance, ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: advance(), range(40)))
    shown = capsys.readouterr()
    assert shown.out == ""
    lines = shown.err.splitlines()
    assert lines == [f"things: {n} of 40" for n in range(0, 41, 4)]


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
