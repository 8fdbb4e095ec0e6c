"""A drive that runs on the virtual board, in the browser."""

from __future__ import annotations

import functools

from directmpc.scope import command
from scripts.commands.scope import served
from scripts.shared.command import Command

COMMAND = Command(
    "demo", __doc__, functools.partial(command.add_arguments, demo=True), served, failed=1
)
