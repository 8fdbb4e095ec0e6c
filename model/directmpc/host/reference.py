"""What a board's link does with the bytes it gets: the model that RTL and host are tested against.

It knows nothing of time: LATE and BUSY are for the tests that bring them about.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from directmpc.host import protocol as p
from directmpc.host.protocol import Controller, Decision, Frame, Identity, Outcome, Type
from directmpc.host.registers import registers_of

_SLVERR = 2  # no such register; also between two


@dataclass
class LinkModel:
    """One link of a board."""

    identity: Identity  # What IDENTIFY is answered with; its `last_sequence` is kept here
    # read, write: Registers: address to (response, word), and (address, word) to response.
    read: Callable[[int], tuple[int, int]]
    write: Callable[[int, int], int]
    step: Callable[[bytes], Decision]  # Payload of a STEP to what the core and the gates answer
    # Position the gates are at, None while they are at none.
    applied: Callable[[], int | None] = lambda: None
    counters: Counter[Outcome] = field(default_factory=Counter)  # Frames by outcome
    # Last sequence number that acted; `protocol.first_sequence` of the link to begin with.
    last: int = 0
    count: int = 0  # Count of the measurement of the last STEP that acted
    recorder: bool = False  # Whether a recorder is built: every link writes its registers

    @property
    def controls(self) -> bool:
        """Whether this link is in control: bit 1 of the identity's options."""
        return bool(self.identity.options & 2)

    def disables(self, frame: Frame) -> bool:
        """Whether a frame writes what a link without control may write.

        That is zero to system.control, and the registers of a recorder that was built.
        """
        known = registers_of(self.identity.controller.name.lower())
        if frame.kind != Type.WRITE:
            return False
        (address,) = struct.unpack("<H", frame.payload[:2])
        if self.recorder and address >> 7 == known["recorder.status"][0] >> 7:
            return True
        return frame.payload == struct.pack("<HI", known["system.control"][0], 0)

    def verdict(self, frame: Frame) -> Outcome:
        """``ACCEPTED`` or the first reason against a frame that its receiver has passed."""
        kind, size = frame.kind, len(frame.payload)
        step_size = p.step_size(self.identity.controller)
        sizes = {**p.REQUEST_SIZE, Type.STEP: step_size}
        if kind not in iter(sizes) or sizes[Type(kind)] != size:
            return Outcome.TYPE
        if kind == Type.COUNTERS and frame.payload[0] not in (0, p.COUNTERS_PER_REPLY):
            return Outcome.TYPE
        if kind in p.ACTING and not p.is_newer(frame.sequence, self.last):
            return Outcome.STALE
        if kind in p.ACTING and not self.controls and not self.disables(frame):
            return Outcome.LINK
        if kind == Type.STEP:
            mask = 7 if self.identity.controller is Controller.MPTC else 0x1FF
            applied = self.applied()
            asked = int.from_bytes(frame.payload[-2:], "little")
            if applied is not None and (asked ^ applied) & mask:
                return Outcome.POSITION
            if applied is not None and not p.is_newer_count(asked >> p.COUNT_PLACE, self.count):
                return Outcome.REPEATED
        return Outcome.ACCEPTED

    def reply(self, frame: Frame) -> Frame | None:
        """The reply to a frame that its receiver has passed, REFUSED, or None to a reply."""
        outcome = self.verdict(frame)
        if outcome is not Outcome.ACCEPTED:
            self.counters[outcome] += 1
            if frame.kind & p.REPLY:
                return None
            payload = struct.pack("<BBI", outcome, frame.kind, self.last)
            return Frame(Type.REFUSED | p.REPLY, frame.sequence, payload)
        kind = Type(frame.kind)
        if kind in p.ACTING:
            self.last = frame.sequence
        if kind is Type.STEP:
            self.count = int.from_bytes(frame.payload[-2:], "little") >> p.COUNT_PLACE
        if kind is Type.IDENTIFY:
            known = self.identity
            payload = Identity(
                known.version, known.controller, known.explorers, known.options, self.last,
                known.clock, known.limit,
            ).pack()  # fmt: skip
        elif kind is Type.COUNTERS:
            first = frame.payload[0]
            counts = [
                self.counters[Outcome(n)] if n in iter(Outcome) else 0
                for n in range(first, first + p.COUNTERS_PER_REPLY)
            ]
            payload = struct.pack(f"<{p.COUNTERS_PER_REPLY}I", *counts)
        elif kind is Type.READ:
            (address,) = struct.unpack("<H", frame.payload)
            response, word = (_SLVERR, 0) if address % 4 else self.read(address)
            payload = struct.pack("<HBI", address, response, word)
        elif kind is Type.WRITE:
            address, word = struct.unpack("<HI", frame.payload)
            response = _SLVERR if address % 4 else self.write(address, word)
            payload = struct.pack("<HB", address, response)
        else:
            payload = self.step(frame.payload).pack()
        self.counters[Outcome.ACCEPTED] += 1
        return Frame(kind | p.REPLY, frame.sequence, payload)

    def receive(self, stuffed: bytes) -> Frame | None:
        """Serve the bytes between two delimiters; None for a broken frame or a reply."""
        outcome, frame = p.judge(stuffed)
        if frame is None:
            self.counters[outcome] += 1
            return None
        return self.reply(frame)
