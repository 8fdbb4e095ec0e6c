"""`make site`: build the documentation as a site into build/site, without network."""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path

from directmpc.host.console import terminable
from scripts.publish import site
from scripts.shared.command import Command
from scripts.shared.tools import ToolError


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, default=site.SITE, help="folder of the site")


def _run(given: argparse.Namespace) -> int | None:
    if importlib.util.find_spec("mkdocs") is None or importlib.util.find_spec("material") is None:
        raise ToolError(
            "MkDocs with its theme material is not installed; run 'make site', which installs "
            "requirements-site.txt"
        )
    with terminable():
        count = site.build(given.out)
    print(f"{given.out / 'index.html'}: written, site of {count} files")
    return 0


COMMAND = Command(
    "site", __doc__, _arguments, _run, interrupted="nothing was replaced",
    outputs=(), folders=("out",),
)  # fmt: skip
