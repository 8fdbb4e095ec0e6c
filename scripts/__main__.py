"""The command line of the project: ``python -m scripts <command> ...``.

Each file of `scripts/commands/` is a command, which is imported when it is asked for only.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from directmpc.host.console import interrupted, reported
from scripts.shared.command import described

COMMANDS = Path(__file__).resolve().parent / "commands"


def commands() -> dict[str, Path]:
    """Name and file of every command."""
    files = sorted(path for path in COMMANDS.glob("*.py") if path.stem != "__init__")
    return {path.stem.replace("_", "-"): path for path in files}


def _overview() -> str:
    """The commands with what each does, from the first lines of their files."""
    lines = ["usage: python -m scripts COMMAND [ARGUMENTS]; COMMAND --help says more", ""]
    for name, path in commands().items():
        lines.append(f"  {name:<18} {described(path).splitlines()[0]}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Hand the arguments to a command; 2 when there is none of that name."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        return reported("scripts", lambda: print(_overview()) or 0)
    known = commands()
    if given[0] not in known:
        names = ", ".join(known)
        print(f"scripts: no command '{given[0]}'; there are: {names}", file=sys.stderr)
        return 2
    try:
        module = importlib.import_module(f"scripts.commands.{known[given[0]].stem}")
        return module.cli.main(given[1:])
    except ValueError as error:
        from directmpc.converter import ConverterError  # not above: numerics come with it

        if not isinstance(error, ConverterError):
            raise
        print(f"{given[0]}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:  # before the command itself could take it
        print(f"{given[0]}: interrupted", file=sys.stderr)
        return interrupted()


if __name__ == "__main__":
    sys.exit(main())
