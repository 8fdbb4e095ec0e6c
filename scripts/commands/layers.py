"""`make layers`: draw the layers of the project from its imports into docs/layers.svg."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scripts.publish import layers
from scripts.shared import tools
from scripts.shared.command import command, option


@command(formats={"out": ".svg"})
@option("--out", type=Path, default=layers.PICTURE, help="picture (SVG)")
@option("--check", action="store_true", help="compare, write nothing")
def cli(given: argparse.Namespace) -> int | None:
    text = layers.text()
    if given.check:
        current = given.out.exists() and given.out.read_text(encoding="utf-8") == text
        if not current:
            print(f"layers: {given.out} is out of date; make layers", file=sys.stderr)
        return 0 if current else 1
    tools.write(given.out, text)
    print(given.out)
    return 0
