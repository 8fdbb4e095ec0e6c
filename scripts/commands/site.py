"""`make site`: build the documentation as a site into build/site, without network."""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path

from directmpc.host.console import terminable
from scripts.publish import site
from scripts.shared.command import command, option
from scripts.shared.tools import ToolError


@command(interrupted="nothing was replaced", outputs=(), folders=("out",))
@option("--out", type=Path, default=site.SITE, help="folder of the site")
def cli(given: argparse.Namespace) -> int | None:
    if importlib.util.find_spec("mkdocs") is None or importlib.util.find_spec("material") is None:
        raise ToolError(
            "MkDocs with its theme material is not installed; run 'make site', which installs "
            "requirements-site.txt"
        )
    with terminable():
        count = site.build(given.out)
    print(f"{given.out / 'index.html'}: written, site of {count} files")
    return 0
