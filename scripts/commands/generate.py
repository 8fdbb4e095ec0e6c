"""Rewrite the files that are generated from the model."""

from __future__ import annotations

import argparse
import importlib

from scripts.shared.command import command, option

#: Modules of `scripts.generate`, in the order in which they need one another.
GENERATORS = (
    "mpdcc_package",
    "converter_pages",
    "mptc_package",
    "kbest_package",
    "observer_packages",
    "core_shells",
    "register_files",
    "link_package",
    "recorder_package",
    "protocol_examples",
    "boards",
    "fusesoc_cores",
)


@command()
@option(
    "only", nargs="*", choices=(*GENERATORS, []), metavar="GENERATOR",
    help=f"one or more of {', '.join(GENERATORS)}; all without it",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    for name in given.only or GENERATORS:
        importlib.import_module(f"scripts.generate.{name}").write()
    return 0
