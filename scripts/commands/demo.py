"""A drive that runs on the virtual board, in the browser."""

from __future__ import annotations

import argparse
import functools

from directmpc.scope import command as page
from scripts.commands.scope import served
from scripts.shared.command import command


@command(functools.partial(page.add_arguments, demo=True), failed=1)
def cli(given: argparse.Namespace) -> int:
    """Serve the page of a demonstration."""
    return served(given)
