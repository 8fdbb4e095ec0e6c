"""What both parts of `make report` share."""

from __future__ import annotations

import subprocess
import sys

from scripts.shared.tools import ROOT, ToolError


class ReportError(ToolError):
    """A figure cannot be published."""


def run_script(name: str, *arguments: str) -> None:
    """Run one of the commands; its progress goes to stderr."""
    command = [sys.executable, "-m", "scripts", name, *arguments]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise ReportError(f"'{' '.join(['python', *command[1:]])}' failed:\n{done.stdout[-1000:]}")
