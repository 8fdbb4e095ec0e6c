"""The frame protocol of the host links: the only place where its constants are written down.

One frame format serves UART and SPI alike, in both directions::

    type (1)  length (1)  sequence (4)  payload (length)  CRC-32 (4)

little-endian, CRC-32 as of Ethernet and zlib over everything in front of it, the whole stuffed by
COBS so that a zero byte is seen between frames alone, and sent between two zero bytes. Whatever
happened to the line before, the next zero byte puts the receiver into step again.

``make generate`` writes the constants to ``rtl/links/link_constants.vhd``; docs/protocol.md
describes the whole, its examples are written by ``python -m scripts.generate.protocol_examples``.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

VERSION = 2
"""Of the protocol: counts up when a frame changes its meaning."""

HEADER_SIZE = 6  # type, length, sequence
CRC_SIZE = 4
OVERHEAD = HEADER_SIZE + CRC_SIZE
MAX_PAYLOAD = 32
MAX_FRAME = MAX_PAYLOAD + OVERHEAD  # bytes before stuffing; COBS adds exactly one
LONGEST_DECISION = 4_000
"""Clocks after which a STEP is answered without a decision, whatever the controller.

The longest decision is that of one explorer without a budget, with prediction, observer and
filters.
"""
DELIMITER = 0
REPLY = 0x80
"""Bit of the type that marks a frame of the board."""

CRC_POLYNOMIAL = 0xEDB88320  # reflected
CRC_RESIDUE = 0xDEBB20E3
"""What the register holds after a frame and its CRC, before the final inversion."""


class Type(IntEnum):
    """Types of request; the reply's has ``REPLY`` set."""

    IDENTIFY = 0x01  # what is this board
    COUNTERS = 0x02  # eight counters of outcomes
    READ = 0x03  # a register
    WRITE = 0x04  # a register
    STEP = 0x05  # measurements in, decision out
    REFUSED = 0x7F  # replies only: a whole frame that is not served, and why


#: Payload bytes of each request; STEP's depends on the controller.
REQUEST_SIZE = {Type.IDENTIFY: 0, Type.COUNTERS: 1, Type.READ: 2, Type.WRITE: 6}
#: Payload bytes of each reply.
REPLY_SIZE = {
    Type.IDENTIFY: 16,
    Type.COUNTERS: 32,
    Type.READ: 7,
    Type.WRITE: 3,
    Type.STEP: 12,
    Type.REFUSED: 6,
}
ACTING = (Type.WRITE, Type.STEP)
"""Requests that change something: their sequence number has to be new."""


class Outcome(IntEnum):
    """Outcome of a frame. Every frame counts under exactly one, the first that applies."""

    ACCEPTED = 0  # served
    LINE = 1  # a byte was broken on the line (UART stop bit), or SPI ended within the frame
    OVERSIZED = 2  # more than MAX_FRAME bytes
    STUFFING = 3  # the delimiter came before COBS expected it
    SHORT = 4  # fewer than OVERHEAD bytes
    LENGTH = 5  # the length byte is not that of the frame
    CRC = 6  # wrong CRC-32
    LATE = 7  # more time than the limit between its first byte and its end
    BUSY = 8  # the request before is still being served
    TYPE = 9  # unknown type, a payload of another size than the type's, or a reply
    STALE = 10  # sequence number not above this link's last: replayed, overtaken, of the other link
    LINK = 11  # STEP or WRITE on the link that is not in control, but for a disable
    POSITION = 12  # s(k-1) or u is not what the gates are at
    REPEATED = 13  # the measurement's count is not above this link's last, while the gates are on


OUTCOME_COUNT = 16  # counters there are; those without a name stay at 0
COUNTERS_PER_REPLY = 8


class Controller(IntEnum):
    """Build option of the top."""

    MPDCC = 1
    MPTC = 2
    KBEST = 3


#: 16-bit words of a STEP request by controller; positions or vector follow as another.
STEP_WORDS = {Controller.MPDCC: 13, Controller.MPTC: 8, Controller.KBEST: 13}


def step_size(controller: Controller) -> int:
    """Payload bytes of a STEP request: 28 for MPDCC and K-best, 18 for MPTC."""
    return 2 * STEP_WORDS[controller] + 2


class Flag(IntEnum):
    """Bits of a STEP reply's flags."""

    HELD = 0  # s(k-1) was kept
    DEADLOCK = 1  # no candidate stays inside its bounds
    SATURATED = 2  # a value did not fit its word
    CLAMPED = 3  # MPFC cannot reach the torque reference
    NO_ANSWER = 4  # the core gave no decision in time
    ENABLED = 5  # the gate guard lets the gates through
    TRIPPED = 6  # the gate guard holds a fault
    EXHAUSTED = 7  # the budget ended the search, the decision is the best so far


class ProtocolError(ValueError):
    """A malformed frame, or a reply that was not expected."""


# ---------------------------------------------------------------------------------------------
# Frames
# ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """A frame as both ends see it."""

    kind: int  # Type byte, 0 to 255
    sequence: int  # 0 to 2**32 - 1
    payload: bytes = b""  # At most ``MAX_PAYLOAD``

    def body(self) -> bytes:
        """The frame with its CRC-32, not stuffed; ProtocolError above MAX_PAYLOAD bytes.

        Type, length, sequence number, payload, CRC; OVERHEAD to MAX_FRAME bytes.
        """
        if len(self.payload) > MAX_PAYLOAD:
            raise ProtocolError(f"payload of {len(self.payload)} bytes; at most {MAX_PAYLOAD} fit")
        head = struct.pack("<BBI", self.kind, len(self.payload), self.sequence)
        return head + self.payload + struct.pack("<I", zlib.crc32(head + self.payload))

    def wire(self) -> bytes:
        """The stuffed bytes with both delimiters; ProtocolError above MAX_PAYLOAD bytes."""
        return bytes([DELIMITER]) + stuff(self.body()) + bytes([DELIMITER])


def stuff(data: bytes) -> bytes:
    """COBS of at most 253 bytes: one more, without a zero among them; ProtocolError above."""
    if len(data) > 253:
        raise ProtocolError(f"{len(data)} bytes are more than one COBS block")
    out = bytearray()
    for block in data.split(b"\0"):
        out += bytes([len(block) + 1]) + block
    return bytes(out)


def unstuff(data: bytes) -> bytes:
    """Undo ``stuff``; ProtocolError where the blocks do not add up."""
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        block = data[at + 1 : at + code]
        if code == 0 or len(block) != code - 1 or 0 in block:
            raise ProtocolError("broken stuffing")
        out += block
        at += code
        if at < len(data):
            out.append(0)
    return bytes(out)


def judge(stuffed: bytes) -> tuple[Outcome, Frame | None]:
    """What a receiver makes of the bytes between two delimiters, as the RTL does.

    ``ACCEPTED`` and the frame, or the first reason that applies and None.
    """
    # The receiver counts what it has unstuffed, so a frame is too long before it is broken.
    body, left = bytearray(), 0
    for index, byte in enumerate(stuffed):
        if left == 0:
            if index:
                body.append(0)
            left = byte - 1
        else:
            body.append(byte)
            left -= 1
        if len(body) > MAX_FRAME:
            return Outcome.OVERSIZED, None
    if left:
        return Outcome.STUFFING, None
    if len(body) < OVERHEAD:
        return Outcome.SHORT, None
    kind, length, sequence = struct.unpack_from("<BBI", body)
    if length + OVERHEAD != len(body):
        return Outcome.LENGTH, None
    if zlib.crc32(body[:-CRC_SIZE]) != int.from_bytes(body[-CRC_SIZE:], "little"):
        return Outcome.CRC, None
    return Outcome.ACCEPTED, Frame(kind, sequence, bytes(body[HEADER_SIZE:-CRC_SIZE]))


NUMBER_BITS = 31
"""Bits of a sequence number below the one that is the link: 0 UART, 1 SPI."""


def first_sequence(link: int) -> int:
    """Last sequence number of a link (0 UART, 1 SPI) on which nothing has acted yet."""
    return link << NUMBER_BITS


def next_sequence(sequence: int) -> int:
    """The sequence number (32 bits) after one; the link's first after its last."""
    return sequence >> NUMBER_BITS << NUMBER_BITS | (sequence + 1) % 2**NUMBER_BITS


def is_newer(sequence: int, last: int) -> bool:
    """Whether a sequence number is of the same link as the last one and lies ahead of it.

    By 1 to 2**30, modulo 2**31.
    """
    same = sequence >> NUMBER_BITS == last >> NUMBER_BITS
    return same and 0 < (sequence - last) % 2**NUMBER_BITS <= 2 ** (NUMBER_BITS - 1)


class Splitter:
    """Cuts a stream of bytes into frames at the delimiters, whatever lies between them."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """The stuffed bytes of every frame that ended; empty ones are idle time.

        Frames may begin and end anywhere in `data`; what has not ended is kept.
        """
        found = []
        for byte in data:
            if byte != DELIMITER:
                self._pending.append(byte)
            elif self._pending:
                found.append(bytes(self._pending))
                self._pending.clear()
        return found


# ---------------------------------------------------------------------------------------------
# Payloads
# ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Identity:
    """Reply to IDENTIFY: 16 bytes."""

    version: int  # Of the protocol
    controller: Controller  # Build option
    explorers: int  # Of MPDCC, else 0
    # Bit 0: paper's explorers (FOLDED) or, for MPTC, MPFC built in; bit 1: this link is in control.
    options: int
    last_sequence: int  # Last sequence number that was acted upon on this link; bit 31 is the link
    clock: int  # Clock of the core, Hz
    limit: int  # Clocks a frame may take from its first byte to its end on this link

    FORMAT = "<BBBBIII"

    @classmethod
    def unpack(cls, payload: bytes) -> Identity:
        """Read a payload; ProtocolError unless it has 16 bytes and a known controller."""
        if len(payload) != struct.calcsize(cls.FORMAT):
            raise ProtocolError(f"an identity of {len(payload)} bytes; it has 16")
        version, controller, explorers, options, last, clock, limit = struct.unpack(
            cls.FORMAT, payload
        )
        if controller not in list(Controller):
            raise ProtocolError(f"an identity with the controller {controller}; there is none")
        return cls(version, Controller(controller), explorers, options, last, clock, limit)

    def pack(self) -> bytes:
        """The payload, 16 bytes, little-endian."""
        return struct.pack(
            self.FORMAT, self.version, self.controller, self.explorers, self.options,
            self.last_sequence, self.clock, self.limit,
        )  # fmt: skip


@dataclass(frozen=True)
class Decision:
    """Reply to STEP: 12 bytes."""

    position: int  # MPDCC: s_a + 8*s_b + 64*s_c. MPTC: u + 8*(switch states, phase a in bit 2)
    flags: int  # Bits as in ``Flag``
    length: int  # L* in steps, 0 for MPTC
    cycles: int  # Clocks from the core's start to its valid
    faults: int  # Latched fault codes of the gate guard
    gates: int  # Gate signals at the time of the reply, one bit each

    FORMAT = "<HBBHHI"

    @classmethod
    def unpack(cls, payload: bytes) -> Decision:
        """Read a payload; ProtocolError unless it has 12 bytes."""
        if len(payload) != struct.calcsize(cls.FORMAT):
            raise ProtocolError(f"a decision of {len(payload)} bytes; it has 12")
        return cls(*struct.unpack(cls.FORMAT, payload))

    def pack(self) -> bytes:
        """The payload, 12 bytes, little-endian."""
        return struct.pack(
            self.FORMAT, self.position, self.flags, self.length, self.cycles, self.faults,
            self.gates,
        )  # fmt: skip

    def has(self, flag: Flag) -> bool:
        """Whether a flag is set."""
        return bool(self.flags >> flag & 1)

    @property
    def positions(self) -> tuple[int, int, int]:
        """MPDCC's switch positions of the three phases."""
        return self.position & 7, self.position >> 3 & 7, self.position >> 6 & 7


#: Lowest bit of the measurement's count in the last word of a STEP, and its bits.
COUNT_PLACE, COUNT_BITS = 9, 7


def is_newer_count(count: int, last: int) -> bool:
    """Whether a measurement's count is one that a board with its gates on takes.

    It is ahead by 1 to 64, modulo 128.
    """
    return 1 <= (count - last) % 2**COUNT_BITS <= 2 ** (COUNT_BITS - 1)


def step_payload(words: list[int], position: int, count: int) -> bytes:
    """Payload of a STEP request, little-endian, of the lower 16 bits of each word.

    `position` (9 bits): s(k-1) packed, or u; `count`: lower seven bits of the measurement's number.
    """
    if not 0 <= position < 1 << COUNT_PLACE:
        raise struct.error(f"position: got {position}, allowed: 0 to {(1 << COUNT_PLACE) - 1}")
    last = position | count % 2**COUNT_BITS << COUNT_PLACE
    return struct.pack(f"<{len(words) + 1}H", *(w & 0xFFFF for w in words), last)


def packed_positions(s: tuple[int, int, int] | list[int]) -> int:
    """Switch positions of three phases in a word: s_a + 8*s_b + 64*s_c."""
    return int(s[0]) + 8 * int(s[1]) + 64 * int(s[2])
