"""`make release`: wheel, FMUs, netlists, FuseSoC cores, site, bitstreams of a clean commit."""

from __future__ import annotations

import argparse
from pathlib import Path

from directmpc.host.console import terminable
from scripts.publish import release
from scripts.shared.command import command, count, option


@command(interrupted="nothing was written", outputs=(), folders=("out",))
@option("--out", type=Path, default=release.FOLDER, help="folder of the release")
@option("--key", type=Path, help="private key of OpenSSH that signs SHA256SUMS; not signed without")
@option("--jobs", type=count, default=2, help="processes of the tests")
@option(
    "--only", nargs="+", choices=release.PARTS, default=tuple(release.PARTS), metavar="PART",
    help=f"of {', '.join(release.PARTS)}; the tests run in any case",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    with terminable():
        out = release.build(given.out, given.jobs, given.only, key=given.key)
    print(f"{out}: written, {len(release.sums(out))} files; see SHA256SUMS and release.json")
    if given.key is None:
        print("SHA256SUMS is not signed: --key names a private key of OpenSSH that signs it")
    return 0
