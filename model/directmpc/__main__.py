"""Commands of the library: the scope of a drive, a first look at one, FMUs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from directmpc.api.drive_file import load_drive
from directmpc.fmu import FmuError, command
from directmpc.host.console import OneParagraphParser, report_error, reported
from directmpc.host.link import LinkError
from directmpc.native import NativeError
from directmpc.scope import command as scope


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = OneParagraphParser(prog="directmpc", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True, parser_class=OneParagraphParser)
    text = "the controller of a drive, which is the RTL, or its plant, for a simulator with FMI"
    command.add_arguments(commands.add_parser("fmu", help=text, description=text))
    text = "a page in the browser that shows a board, the virtual board or a recorded run"
    scope.add_arguments(commands.add_parser("scope", help=text, description=text))
    text = "a drive that runs on the virtual board, in the browser"
    scope.add_arguments(commands.add_parser("demo", help=text, description=text), demo=True)
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Do one command."""
    return reported("directmpc", lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    """What `main` does, but for a standard output that takes no more."""
    given = _arguments(arguments)
    if given.command in ("scope", "demo"):
        try:
            return scope.run(given)
        except (NativeError, LinkError, ValueError, OSError) as error:
            report_error(given.command, error)
            return 2
    try:
        print(command.write(load_drive(given.drive), given))
    except (NativeError, FmuError, ValueError, OSError) as error:
        report_error("fmu", error, [given.out])
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
