"""What every command of ``python -m scripts`` does alike: arguments, errors, exit codes.

An error is one paragraph on stderr that begins with the command's name. Exit code 2 says that the
input was wrong or a tool is missing, 1 that a check or a measurement failed, 0 that all is well.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from directmpc.host.console import OneParagraphParser, interrupted, report_error
from scripts.shared.tools import ToolError


class InputError(ValueError):
    """What was asked for cannot be done; the message is for a user."""


class UsageError(ValueError):
    """An argument cannot be meant; reported as wrong arguments are."""


@dataclass(frozen=True)
class Command:
    """One command.

    Attributes
    ----------
    name
        As a user types it; errors begin with it.
    summary
        What it does, one line.
    arguments
        Adds its arguments to a parser.
    run
        Does it; returns the exit code, None for 0.
    failed
        Exit code where a tool fails.
    interrupted
        What an interruption leaves, for its message.
    outputs
        Arguments that name files it writes, all of them or none: where it fails, the message says
        that those which existed are as they were.
    """

    name: str
    summary: str
    arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int | None]
    failed: int = 2
    interrupted: str = ""
    outputs: tuple[str, ...] = ("out",)

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Read the arguments, do it, and report what goes wrong; returns the exit code.

        Parameters
        ----------
        arguments : Sequence[str] | None
            Of the command line; the program's own if None.

        Returns
        -------
        int
            Exit code: 0, what `run` returned, `failed`, 2 for wrong input, or 130 if interrupted.

        Raises
        ------
        SystemExit
            With 2 where an argument is wrong, with 0 after --help.
        """
        parser = OneParagraphParser(prog=self.name, description=self.summary)
        self.arguments(parser)
        given = parser.parse_args(arguments)
        try:
            return self.run(given) or 0
        except UsageError as error:
            parser.error(str(error))
        except (ToolError, ValueError, OSError) as error:
            paths = [getattr(given, name, None) for name in self.outputs]
            report_error(self.name, error, [path for path in paths if path is not None])
            return self.failed if isinstance(error, ToolError) else 2
        except KeyboardInterrupt:
            said = "; ".join(filter(None, ["interrupted", self.interrupted]))
            print(f"{self.name}: {said}", file=sys.stderr)
            return interrupted()


@dataclass(frozen=True)
class Program:
    """A command line of the library, under the project's.

    Attributes
    ----------
    main
        Takes the arguments and returns the exit code.
    """

    main: Callable[[Sequence[str] | None], int]
