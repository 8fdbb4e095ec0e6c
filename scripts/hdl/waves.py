"""A view of recorded signals: the file with which GTKWave opens them in groups, with their formats.

`ghdl.execute` records every signal of a bench in the format FST, which GTKWave and Surfer read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

_BIT, _SIGNED, _UNSIGNED, _COMMENT = "@28", "@420", "@24", "@200"
"""Flags of GTKWave for the lines that follow: binary, signed decimal, decimal, a comment."""

Signal = tuple[str, int, bool]
"""Name with the instances before it, bits, and whether it is signed."""


def view(recorded: str, groups: Mapping[str, Sequence[Signal]]) -> str:
    """A save file of GTKWave."""
    lines = [f"[*] gtkwave {recorded} and this file", f'[dumpfile] "{recorded}"', "[timestart] 0"]
    for heading, signals in groups.items():
        lines += [_COMMENT, f"-{heading}"]
        for name, bits, signed in signals:
            if bits == 1:
                lines += [_BIT, name]
            else:
                lines += [_SIGNED if signed else _UNSIGNED, f"{name}[{bits - 1}:0]"]
    return "\n".join(lines) + "\n"
