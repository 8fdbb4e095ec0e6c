"""Byte-exact examples of the frame protocol, as docs/protocol.md shows them.

``python -m scripts generate`` writes them between the page's marks; lint
finds the page out of date otherwise.
"""

from __future__ import annotations

import inspect
import re
import struct
from pathlib import Path

from directmpc.host import protocol as p
from directmpc.host.protocol import Controller, Decision, Frame, Identity, Outcome, Type
from scripts.shared import tables, tools

PAGE = Path(__file__).resolve().parents[2] / "docs" / "protocol.md"
_MARKS = ("<!-- {}: begin (written by make generate) -->", "<!-- {}: end -->")

MEASUREMENTS = (
    15000,
    -4100,
    7200,
    -6400,
    310,
    15600,
    16050,
    16420,
    32000,
    15200,
    -3900,
    16000,
    15840,
)


def frames() -> list[tuple[str, Frame]]:
    """Examples with a title each."""
    identity = Identity(p.VERSION, Controller.MPDCC, 2, 2, 4, 25_000_000, 125_000)
    measured = p.step_payload(list(MEASUREMENTS), p.packed_positions((6, 2, 1)), 5)
    decided = Decision(p.packed_positions((7, 2, 1)), 1 << p.Flag.ENABLED, 12, 81, 0, 0x35A6AC)
    ended = Decision(
        p.packed_positions((6, 3, 1)),
        1 << p.Flag.ENABLED | 1 << p.Flag.EXHAUSTED,
        9,
        1172,
        0,
        0x3526AC,
    )
    counts = [0] * p.COUNTERS_PER_REPLY
    counts[Outcome.ACCEPTED], counts[Outcome.CRC] = 70, 2
    return [
        ("IDENTIFY, sequence number 1", Frame(Type.IDENTIFY, 1)),
        ("its reply: MPDCC with two explorers, 25 MHz", Frame(0x81, 1, identity.pack())),
        (
            "WRITE of 0x00000201 to address 0x180",
            Frame(Type.WRITE, 5, struct.pack("<HI", 0x180, 0x201)),
        ),
        ("its reply: done", Frame(0x84, 5, struct.pack("<HB", 0x180, 0))),
        ("READ of address 0x014", Frame(Type.READ, 6, struct.pack("<H", 0x14))),
        ("its reply: 0x00000024", Frame(0x83, 6, struct.pack("<HBI", 0x14, 0, 0x24))),
        ("STEP: 13 words, then s(k-1) = (6, 2, 1) and the count 5", Frame(Type.STEP, 7, measured)),
        ("its reply: s(k) = (7, 2, 1) for 12 steps, 81 clocks", Frame(0x85, 7, decided.pack())),
        ("the same, had SESE's budget ended the search: s(k) = (6, 3, 1), 1172 clocks",
         Frame(0x85, 7, ended.pack())),
        ("the same STEP once more is refused: STALE, last was 7",
         Frame(0xFF, 7, struct.pack("<BBI", Outcome.STALE, Type.STEP, 7))),
        ("COUNTERS 0 to 7", Frame(Type.COUNTERS, 8, b"\0")),
        ("its reply: 70 accepted, 2 with a wrong CRC", Frame(0x82, 8, struct.pack("<8I", *counts))),
    ]  # fmt: skip


def _hex(data: bytes) -> str:
    rows = [data[i : i + 24].hex(" ") for i in range(0, len(data), 24)]
    return "\n".join(f"    {row}" for row in rows)


def _examples() -> str:
    """The examples as Markdown."""
    return "\n\n".join(f"{title}:\n\n{_hex(frame.wire())}" for title, frame in frames())


def _docs(enum: type) -> dict[str, str]:
    """Comments of an enumeration's members, from its source."""
    source = inspect.getsource(inspect.getmodule(enum) or enum)
    body = source.split(f"class {enum.__name__}(IntEnum)")[1].split("\n\n\n")[0]
    return dict(re.findall(r"^    (\w+) = \w+  # (.*)$", body, re.M))


def _outcomes() -> str:
    """The table of outcomes as Markdown."""
    docs = _docs(Outcome)
    rows = [(o.value, f"`{o.name}`", docs[o.name]) for o in Outcome]
    return tables.markdown(("value", "name", "meaning"), rows, "rl")


def page(text: str) -> str:
    """The page with everything between its marks written anew."""
    for name, body in (("examples", _examples()), ("outcomes", _outcomes())):
        begin, end = (mark.format(name) for mark in _MARKS)
        text = tables.between(text, body, begin, end)
    return text


def write() -> None:
    """Write the page's examples."""
    tools.write(PAGE, page(PAGE.read_text(encoding="utf-8")))
