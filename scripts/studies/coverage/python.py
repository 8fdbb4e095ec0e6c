"""Branches of the Python library that a stated set of quick tests takes.

Compiled functions run as plain Python meanwhile (``NUMBA_DISABLE_JIT``), so that their branches
count as well.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from scripts.shared import tools
from scripts.shared.tools import ROOT, ToolError

LIBRARY = ROOT / "model" / "directmpc"
#: Seconds that the tests may take.
TIMEOUT = 1800


def measure(tests: Sequence[str]) -> dict[str, tuple[int, int]]:
    """Run tests and count branches."""
    with tempfile.TemporaryDirectory(prefix="coverage-") as name:
        folder = Path(name)
        data = f"--data-file={folder / 'data'}"
        environment = {
            "NUMBA_DISABLE_JIT": "1",
            "PYTHONPATH": os.pathsep.join([str(ROOT / "model"), str(ROOT)]),
        }
        python = ["env", *(f"{k}={v}" for k, v in environment.items()), sys.executable, "-m"]
        command = [*python, "coverage", "run", data, "--branch", f"--source={LIBRARY}"]
        options = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not thorough"]
        tools.run([*command, *options, *tests], cwd=ROOT, timeout=TIMEOUT)
        out = folder / "out.json"
        tools.run([*python, "coverage", "json", data, "-q", "-o", str(out)], cwd=ROOT)
        read = json.loads(out.read_text(encoding="utf-8"))
    found: dict[str, tuple[int, int]] = {}
    for path, one in read["files"].items():
        inside = (ROOT / path).resolve().relative_to(LIBRARY)
        part = inside.parts[0] if len(inside.parts) > 1 else "directmpc"
        taken, of = found.get(part, (0, 0))
        summary = one["summary"]
        found[part] = (taken + summary["covered_branches"], of + summary["num_branches"])
    if not found:
        raise ToolError("coverage.py has counted nothing")
    return dict(sorted(found.items()))
