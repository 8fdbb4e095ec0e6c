"""What every command line does alike: wrong arguments, errors, exit codes.

An error is one paragraph on stderr that begins with the command's name. Exit code 2 says that the
input was wrong or a tool is missing, 1 that a check failed.
"""

from __future__ import annotations


class InputError(ValueError):
    """What was asked for cannot be done; the message is for a user."""
