"""Bytes that nobody meant, for everything that reads them: drive files, traces, frames.

A parser may refuse with its own error, one paragraph that names what is wrong, or accept. Any other
exception is a finding, and so is a frame that is accepted and does not come out as the same bytes.
What is accepted goes one step on: registers of a drive, payload of a frame, text of a trace.

The bytes are well-formed examples that were changed: bits, bytes, numbers and lines, pieces of two
of them joined. They are seeded.
"""

from __future__ import annotations

import math
import random
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from directmpc.api.drive_file import load_drive, shipped_drives
from directmpc.csv_table import TraceError
from directmpc.drive_tables import DriveError
from directmpc.host import protocol as p
from directmpc.host.reference import LinkModel
from directmpc.host.registers import values
from directmpc.mpdcc import trace as mpdcc_trace
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.drive import MptcDrive
from scripts.hdl import states

#: Numbers that parsers find hard.
NUMBERS = (
    b"0", b"-0", b"1e400", b"-1e-400", b"nan", b"inf", b"-inf", b"1_000", b"0x10", b"1e", b"+1",
    b"9" * 30, b"9" * 5000, b"1." + b"0" * 400, b"\xd9\xa1", b"--1", b"1,5", b"true", b'"1"', b"[]",
)  # fmt: skip


@dataclass(frozen=True)
class Target:
    """Something that reads bytes."""

    read: Callable[[bytes, Path], None]  #: Reads them; refuses with one of `refusals`.
    refusals: tuple[type[Exception], ...]  #: Its own errors.
    examples: Callable[[], list[bytes]]  #: Well-formed bytes.


@dataclass(frozen=True)
class Finding:
    """Bytes that a parser takes in a way that it must not."""

    target: str  #: Name of the target.
    data: bytes  #: The bytes.
    says: str  #: The end of the traceback.


def _drive(data: bytes, folder: Path) -> None:
    path = folder / "drive.toml"
    path.write_bytes(data)
    drive = load_drive(path)
    if not isinstance(drive, MptcDrive):
        return  # its registers take a second each, or it has none
    try:
        values(drive, clock=25_000_000)
    except ValueError as error:  # a combination that does not fit the core's words
        if "\n\n" in str(error) or not str(error):
            raise AssertionError(f"no one-paragraph message: {error!r}") from None


def _mpdcc_trace(data: bytes, folder: Path) -> None:
    path = folder / "trace.csv"
    path.write_bytes(data)
    found = mpdcc_trace.read_trace(path, states.shipped("anpc5l_6kv"))
    assert np.isfinite(found.x_m).all()
    assert ((found.s_prev >= 0) & (found.s_prev <= 7)).all()
    mpdcc_trace.write_trace(path, found)


def _mptc_trace(data: bytes, folder: Path) -> None:
    path = folder / "trace.csv"
    path.write_bytes(data)
    # with the columns of sequences if there are any
    found = mptc_trace.read_trace(path, sequences=b"u1" in data)
    assert np.isfinite(found.i_s).all()
    assert ((found.u >= 0) & (found.u <= 7)).all()
    mptc_trace.write_trace(folder / "again.csv", found)


def _decisions(data: bytes, folder: Path) -> None:
    path = folder / "decisions.csv"
    path.write_bytes(data)
    for read in (mpdcc_trace.read_decisions, mptc_trace.read_decisions):
        try:
            read(path)
        except TraceError:
            continue


def _frames(data: bytes, folder: Path) -> None:
    del folder
    splitter, parts = p.Splitter(), []
    for begin in range(0, len(data), 7):
        parts += splitter.feed(data[begin : begin + 7])
    nothing = p.Decision(0, 0, 0, 0, 0, 0)
    identity = p.Identity(p.VERSION, p.Controller.MPTC, 0, 2, 0, 25_000_000, 125_000)
    board = LinkModel(identity, lambda _: (0, 0), lambda *_: 0, lambda _: nothing)
    for part in parts:
        outcome, frame = p.judge(part)
        answer = board.receive(part)
        assert (answer is None) == (frame is None or bool(frame.kind & p.REPLY))
        # on a line that echoes it falls silent
        assert answer is None or board.receive(answer.wire()[1:-1]) is None
        assert (frame is None) == (outcome is not p.Outcome.ACCEPTED)
        if frame is None:
            continue
        assert p.Splitter().feed(frame.wire()) == [part]
        for unpack in (p.Identity.unpack, p.Decision.unpack):
            try:
                unpack(frame.payload)
            except p.ProtocolError:
                continue


def _drive_examples() -> list[bytes]:
    return [text.encode() for text in shipped_drives().values()]


def _trace_text(controller: str) -> list[bytes]:
    with tempfile.TemporaryDirectory(prefix="directmpc-fuzz-") as name:
        path = Path(name) / "trace.csv"
        rng = np.random.default_rng(1)
        if controller == "mpdcc":
            mpdcc_trace.write_trace(path, states.near(states.shipped("anpc5l_6kv"), 3, rng))
            return [path.read_bytes()]
        head = "is_alpha,is_beta,psis_alpha,psis_beta,omega_r,torque_ref,psi_ref,u"
        rows = ["1.5,-2,0.9,0.1,100,5,0.95,3", "-0.1,0,0,0.9,-300,-5.5,0.9,7"]
        whole = "\n".join([head, *rows, ""])
        wide = [f"{head},u1,u2,u3,t1,t2", *(f"{row},1,0,0,0.25,0.75" for row in rows), ""]
        return [whole.encode(), "\n".join(wide).encode()]


def _decision_text() -> list[bytes]:
    return [
        b"s_a,s_b,s_c,held,deadlock,length,cycles,saturated\n1,2,3,0,0,7,82,0\n0,0,0,1,0,0,21,0\n",
        b"u,cycles,saturated\n3,39,0\n7,78,1\n",
    ]


def _frame_examples() -> list[bytes]:
    kinds = [kind | bit for bit in (0, p.REPLY) for kind in p.Type]
    frames = [p.Frame(kind, 5, bytes(range(n))) for kind in kinds for n in (0, 2, 16, 32)]
    return [frame.wire() for frame in frames] + [b"".join(f.wire() for f in frames[:4])]


TARGETS: dict[str, Target] = {
    "drive file": Target(_drive, (DriveError, ValueError), _drive_examples),
    "trace of MPDCC": Target(_mpdcc_trace, (TraceError,), lambda: _trace_text("mpdcc")),
    "trace of MPTC": Target(_mptc_trace, (TraceError,), lambda: _trace_text("mptc")),
    "decisions": Target(_decisions, (TraceError,), _decision_text),
    "frames": Target(_frames, (), _frame_examples),
}


def mutated(data: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """An example, changed in some places."""
    found = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 4, 9])):
        at = rng.randrange(len(found) + 1)
        turn = rng.randrange(9)
        if turn == 0 and at < len(found):
            found[at] ^= 1 << rng.randrange(8)
        elif turn == 1 and at < len(found):
            found[at] = rng.randrange(256)
        elif turn == 2:
            del found[at : at + rng.choice([1, 2, 8, 60])]
        elif turn == 3:
            found[at:at] = rng.randbytes(rng.choice([1, 2, 8]))
        elif turn == 4:
            other = rng.choice(others)
            begin = rng.randrange(len(other) + 1)
            found[at:at] = other[begin : begin + rng.choice([1, 8, 40])]
        elif turn == 5:
            piece = found[at : at + rng.choice([4, 30, 200])]
            found[at:at] = piece * rng.choice([1, 2])
        elif turn == 6:
            found[at:at] = rng.choice([b"\0", b"\r\n", b"\n", b",", b'"', b"\xef\xbb\xbf", b"\xff"])
        elif turn == 7:  # another number in the place of one
            digits = [i for i, byte in enumerate(found) if 48 <= byte <= 57]
            if digits:
                begin = end = rng.choice(digits)
                while end < len(found) and found[end] in b"0123456789.e-":
                    end += 1
                found[begin:end] = rng.choice(NUMBERS)
        else:
            lines = bytes(found).split(b"\n")
            rng.shuffle(lines)
            found = bytearray(b"\n".join(lines))
    return bytes(found)


def tried(name: str, data: bytes, folder: Path) -> Finding | None:
    """Let a target read bytes."""
    target = TARGETS[name]
    try:
        target.read(data, folder)
    except target.refusals as error:
        if not str(error).strip():
            return Finding(name, data, f"{type(error).__name__} without a message")
    except Exception:
        return Finding(name, data, "".join(traceback.format_exc(limit=-4)))
    return None


def run(name: str, seconds: float, seed: int, most: float = math.inf) -> Iterator[Finding | None]:
    """Mutate a target's examples for some time."""
    rng = random.Random(f"{name} {seed}")
    examples = TARGETS[name].examples()
    end = time.monotonic() + seconds
    count = 0
    with tempfile.TemporaryDirectory(prefix="directmpc-fuzz-") as folder:
        while count < most and time.monotonic() < end:
            data = mutated(rng.choice(examples), examples, rng) if count else b""
            count += 1
            yield tried(name, data, Path(folder))
