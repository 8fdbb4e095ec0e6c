"""`make lint`: style, docstrings, clean analysis in both VHDL versions, ports, fresh files.

Every check runs, so that one pass shows all there is to mend; the exit code is 1 if any of them
failed. `--fix` (`make format`) rewrites what the style checkers can rewrite by themselves.
"""

from __future__ import annotations

import argparse

from scripts.measure import checks
from scripts.shared.command import UsageError, command, option


def _fix() -> int:
    said, clean = checks.rewrite()
    print("\n".join(said))
    return 0 if clean else 1


@command(failed=1)
@option("--fix", action="store_true", help="rewrite instead of checking")
@option("only", nargs="*", help="words; only checks with one of them in their name")
def cli(given: argparse.Namespace) -> int | None:
    if given.fix:
        return _fix()
    names = checks.named(given.only)
    if not names:
        words = " ".join(given.only)
        raise UsageError(f"no check is called '{words}'; there are: {', '.join(checks.CHECKS)}")
    failed = 0
    for found in checks.findings(names):
        mark = "FAIL" if found.lines else "ok"
        print(f"{mark:4}  {found.name}  ({found.seconds:.1f} s)", flush=True)
        for line in found.lines:
            print(f"      {line}")
        failed += bool(found.lines)
    if failed:
        print(f"lint: {failed} of {len(names)} checks failed")
    return 1 if failed else 0
