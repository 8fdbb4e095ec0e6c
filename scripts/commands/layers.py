"""`make layers`: draw the layers of the project from its imports into docs/layers.svg."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from directmpc.host.console import OneParagraphParser, report_error
from scripts.publish import layers
from scripts.shared import tools
from scripts.shared.tools import ToolError


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw; with --check compare only, 1 when the picture is out of date."""
    parser = OneParagraphParser(prog="layers", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=layers.PICTURE, help="picture (SVG)")
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    given = parser.parse_args(arguments)
    try:
        text = layers.text()
        if given.check:
            current = given.out.exists() and given.out.read_text(encoding="utf-8") == text
            if not current:
                print(f"layers: {given.out} is out of date; make layers", file=sys.stderr)
            return 0 if current else 1
        tools.write(given.out, text)
    except (ToolError, OSError) as error:
        report_error("layers", error)
        return 2
    print(given.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
