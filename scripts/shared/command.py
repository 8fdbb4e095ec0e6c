"""What every command of ``python -m scripts`` does alike: arguments, errors, exit codes.

An error is one paragraph on stderr that begins with the command's name. Exit code 2 says that the
input was wrong or a tool is missing, 1 that a check or a measurement failed, 0 that all is well.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from directmpc.host.console import OneParagraphParser, interrupted, lost, report_error, reported
from directmpc.output_files import check_folder, check_output, check_suffix
from scripts.shared.tools import BUILD, ToolError


def described(file: Path) -> str:
    """Docstring of a Python file, read from the file itself."""
    return ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""


class InputError(ValueError):
    """What was asked for cannot be done; the message is for a user."""


class UsageError(ValueError):
    """An argument cannot be meant; reported as wrong arguments are."""


def count(text: str) -> int:
    """A number of things in an argument: at least one."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid int value: {text!r}") from None
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {value}; at least 1 is needed")
    return value


@dataclass(frozen=True)
class Command:
    """One command."""

    name: str  #: As a user types it; errors begin with it.
    #: What it does: the first line of it, the docstring of the command's file for instance. Python
    #: drops docstrings with -OO; the line is read from the file then.
    summary: str | None
    arguments: Callable[[argparse.ArgumentParser], None]  #: Adds its arguments to a parser.
    run: Callable[[argparse.Namespace], int | None]  #: Does it; returns the exit code, None for 0.
    failed: int = 2  #: Exit code where a tool fails.
    interrupted: str = ""  #: What an interruption leaves, for its message.
    #: Arguments that name files it writes, all of them or none. That they can be written is found
    #: out before it begins. Where it fails, the message says that those which existed are as they
    #: were.
    outputs: tuple[str, ...] = ("out",)
    #: Arguments that name files which keep what is through where it fails.
    growing: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()  #: Arguments that name folders it makes or fills.
    #: Arguments among them with only one format: the suffix that the name must have.
    formats: Mapping[str, str] = field(default_factory=dict)

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Read the arguments, do it, and report what goes wrong; returns the exit code."""
        return reported(self.name, lambda: self._main(arguments))

    def _main(self, arguments: Sequence[str] | None) -> int:
        """What `main` does, but for a standard output that takes no more."""
        summary = self.summary or described(Path(self.run.__code__.co_filename))
        parser = OneParagraphParser(prog=self.name, description=summary.splitlines()[0])
        self.arguments(parser)
        given = parser.parse_args(arguments)
        paths = self._given(given, self.outputs)
        try:
            self._check_outputs(given)
            return self.run(given) or 0
        except UsageError as error:
            parser.error(str(error))
        except (ToolError, ValueError, OSError) as error:
            if isinstance(error, OSError) and lost(error):
                raise
            report_error(self.name, error, paths)
            return self.failed if isinstance(error, ToolError) else 2
        except KeyboardInterrupt:
            said = "; ".join(filter(None, ["interrupted", self.interrupted]))
            print(f"{self.name}: {said}", file=sys.stderr)
            return interrupted()

    @staticmethod
    def _given(given: argparse.Namespace, names: Sequence[str]) -> list[Path]:
        """The paths among some arguments."""
        found = [getattr(given, name, None) for name in names]
        return [path for path in found if path is not None]

    def _check_outputs(self, given: argparse.Namespace) -> None:
        """Refuse an output that cannot be written; only below build/ is a folder made for one."""
        files, folders = (*self.outputs, *self.growing), self.folders
        for path in self._given(given, (*files, *folders)):
            if BUILD in path.absolute().parents:
                path.parent.mkdir(parents=True, exist_ok=True)
        for path in self._given(given, files):
            check_output(path)
        for path in self._given(given, folders):
            check_folder(path)
        for name, suffix in self.formats.items():
            for path in self._given(given, [name]):
                check_suffix(path, suffix)


Run = Callable[[argparse.Namespace], int | None]


def option(*names: str, exclusive: bool = False, **how: Any) -> Callable[[Run], Run]:
    """An argument of a command, as of ``add_argument``; of the `exclusive` ones one is given."""

    def _with(run: Run) -> Run:
        run.__dict__.setdefault("options", []).insert(0, (names, exclusive, how))
        return run

    return _with


def command(
    add: Callable[[argparse.ArgumentParser], None] | None = None, **how: Any
) -> Callable[[Run], Command]:
    """Make a function the command that its file is named after, as of `Command`, with its options.

    ``add`` adds arguments of the library's.
    """

    def _made(run: Run) -> Command:
        def _arguments(parser: argparse.ArgumentParser) -> None:
            if add is not None:
                add(parser)
            part = None
            for names, exclusive, more in run.__dict__.get("options", ()):
                if exclusive:
                    part = part or parser.add_mutually_exclusive_group()
                (part if exclusive and part else parser).add_argument(*names, **more)

        name = Path(run.__code__.co_filename).stem.replace("_", "-")
        return Command(name, run.__globals__["__doc__"], _arguments, run, **how)

    return _made


scheduled = option(
    "--scheduler",
    metavar="ADDRESS",
    help="a Dask scheduler such as tcp://host:8786, whose workers compute; "
    "without it, processes of this machine",
)
"""Gives a command ``--scheduler``."""


@dataclass(frozen=True)
class Program:
    """A command line of the library, under the project's."""

    main: Callable[[Sequence[str] | None], int]  #: Takes the arguments and returns the exit code.
