"""Commands as a user starts them, and what an error message has to look like."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

NOTHING_LEFT: list[str] = []


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "scripts", "replay", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )


def told(stderr: str) -> list[str]:
    """Lines of standard error but for the one that tells of a long compilation."""
    return [line for line in stderr.splitlines() if not line.startswith("directmpc: compiling")]


def assert_one_paragraph(done: subprocess.CompletedProcess[str], folder: Path) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    lines = told(done.stderr)
    lines = [line for line in lines if not line.startswith("replay on ")]
    assert lines[0].startswith("replay: "), "but for progress, the message is all there is"
    assert done.stderr.count("replay: ") == 1
    assert "\n\n" not in done.stderr.strip()
    assert "Traceback" not in done.stderr
    assert [p.name for p in folder.glob("*out*")] == NOTHING_LEFT
    assert [p.name for p in folder.glob(".*")] == NOTHING_LEFT, "a temporary file stayed behind"


def _heed_interrupts() -> None:
    """Undo an ignored SIGINT that a parent left behind, as nohup and background jobs do."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def started(*arguments: object, **options: Any) -> subprocess.Popen[str]:
    """The replay command as a process under way, deaf to no signal; `options` are Popen's."""
    return subprocess.Popen(
        [sys.executable, "-m", "scripts", "replay", *map(str, arguments)],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_heed_interrupts,
        **options,
    )
