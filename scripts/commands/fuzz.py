"""`make fuzz`: bytes that nobody meant, for what reads drive files, traces, decisions, frames."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.shared import progress
from scripts.shared.command import UsageError, command, option
from scripts.shared.tools import BUILD, replacing
from scripts.studies import fuzz


@command(failed=1, outputs=(), folders=("out",))
@option("only", nargs="*", help=f"targets: {', '.join(fuzz.TARGETS)}; all without")
@option("--minutes", type=float, default=5.0, help="for all targets together")
@option("--seed", type=int, default=1)
@option("--out", type=Path, default=BUILD / "fuzz", help="folder of the findings")
def cli(given: argparse.Namespace) -> int | None:
    if unknown := [name for name in given.only if name not in fuzz.TARGETS]:
        raise UsageError(f"no target '{unknown[0]}'; there are: {', '.join(fuzz.TARGETS)}")
    if not given.minutes > 0:
        raise UsageError(f"argument --minutes: got {given.minutes:g}; more than 0 is needed")
    chosen = given.only or list(fuzz.TARGETS)
    seconds = 60 * given.minutes / len(chosen)
    given.out.mkdir(parents=True, exist_ok=True)
    failed = False
    for name in chosen:
        findings: list[fuzz.Finding] = []
        count = 0
        with progress.busy(f"fuzz: {name}"):
            for found in fuzz.run(name, seconds, given.seed):
                count += 1
                if found is not None:
                    findings.append(found)
                    if len(findings) == 10:
                        break
        print(f"{name}: {count} byte strings, {len(findings)} findings", flush=True)
        for number, found in enumerate(findings):
            path = given.out / f"{name.replace(' ', '_')}-{number}"
            with replacing(path) as temporary:
                temporary.write_bytes(found.data)
            print(f"fuzz: {path}:\n{found.says}", file=sys.stderr)
        failed |= bool(findings)
    return 1 if failed else 0
