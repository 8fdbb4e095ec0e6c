"""VHDL files in compile order for a unit or several, one a line."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.hdl import sources
from scripts.shared.command import command, option


@command()
@option("top", nargs="*", help="entities or packages; each file once; all files without any")
@option("--rtl", type=Path, default=sources.RTL, help="directory of the VHDL files")
@option("--relative-to", type=Path, help="print relative paths")
def cli(given: argparse.Namespace) -> int | None:
    files = sources.rtl_files(given.rtl)
    # `make sources TOP="one other"` hands over one word
    tops = [name for word in given.top for name in word.split() or [""]]
    listed = [sources.compile_order(top, files) for top in tops] or [sources.order_all(files)]
    order = dict.fromkeys(path for one in listed for path in one)
    for path in order:
        shown = path.resolve()
        if given.relative_to is not None:
            shown = shown.relative_to(given.relative_to.resolve())
        print(shown)
    return 0
