"""One request at a time over a stream of bytes: framing, sequence numbers, repetition.

`SerialStream` is a UART (a device, or the virtual board's pseudo-terminal) through pyserial;
anything with `write` and `read` of bytes serves, an SPI master's transactions for instance.
"""

from __future__ import annotations

import errno
import importlib
import math
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import serial

from directmpc.host import protocol as p
from directmpc.host.protocol import Frame, Outcome, Splitter, Type


class LinkError(RuntimeError):
    """The board cannot be reached, or does not answer; the message is for a user."""


class RefusedError(RuntimeError):
    """The board has refused a request, with its outcome and the last sequence number acted upon."""

    def __init__(self, kind: Type, outcome: Outcome, last_sequence: int) -> None:
        super().__init__(f"{kind.name} was refused: {REASONS[outcome]}")
        self.outcome = outcome
        self.last_sequence = last_sequence


REASONS = {
    Outcome.BUSY: "the board is still deciding",
    Outcome.TYPE: "this board does not know it, or not with a payload of that size",
    Outcome.STALE: "its sequence number is not above the last one of this link",
    Outcome.LINK: "the switch on the board gives control to its other link",
    Outcome.POSITION: "the gates are not at the position it says",
    Outcome.REPEATED: "its measurement is not newer than the last one",
}
"""What a REFUSED reply may say."""


class Stream(Protocol):
    """A stream of bytes as a link needs it."""

    def write(self, data: bytes, /) -> object:
        """Send all bytes, delimiters included."""

    def read(self) -> bytes:
        """What has come, at once; waits a little if nothing has, then empty."""


MOST_RATE = 2**31 - 1
"""Fastest bit rate that can be asked for, 1/s: drivers take it as 32 bits, signed."""

_TAKEN = (errno.EAGAIN, errno.EBUSY)
"""What a port says that another program has locked."""


def line_failures() -> tuple[type[Exception], ...]:
    """Errors of a line: `OSError` and, where there is termios, `termios.error`, which is none."""
    found: tuple[type[Exception], ...] = (OSError, ValueError, OverflowError)
    try:
        return (*found, importlib.import_module("termios").error)
    except ImportError:
        return found


def why(error: Exception) -> str:
    """A failure of a line in words, without number, and without port where there is a reason."""
    # pyserial wraps some, and termios.error has no attribute of its number
    for one in (error, error.__context__):
        number = getattr(one, "errno", None)
        if number is None and one is not None and one.args and isinstance(one.args[0], int):
            number = one.args[0]
        if number in _TAKEN:
            return "another program uses it"
        if number is not None:
            return os.strerror(number)
    return str(error)


def check_rate(port: str, rate: int) -> None:
    """LinkError for a rate (bits a second) that no driver can be asked for."""
    if not 1 <= rate <= MOST_RATE:
        raise LinkError(f"{port}: a rate of {rate}; it has to be 1 to {MOST_RATE} bits a second")


class SerialStream:
    """A UART: a device or any URL of pyserial, `baud` in 1/s; LinkError if it cannot be opened."""

    def __init__(self, port: str, baud: int) -> None:
        try:
            import serial  # an optional requirement of the package
        except ImportError:
            raise LinkError("pyserial is not installed; pip install pyserial does it") from None
        check_rate(port, baud)
        self._failures = line_failures()
        self.port = port
        opened: serial.SerialBase | None = None
        try:
            opened = serial.serial_for_url(port, baudrate=baud, timeout=0.05, exclusive=True)
            opened.reset_input_buffer()
        except self._failures as error:
            if opened is not None:
                opened.close()
            raise LinkError(f"{port}: cannot be opened: {why(error)}") from None
        self._serial = opened

    def write(self, data: bytes, /) -> object:
        """Send all bytes, delimiters included; LinkError if the line fails."""
        try:
            return self._serial.write(data)
        except self._failures as error:
            raise LinkError(f"{self.port}: {why(error)}") from None

    def read(self) -> bytes:
        """What has come, at once; waits up to 50 ms if nothing has. LinkError if the line fails."""
        try:
            return self._serial.read(max(1, self._serial.in_waiting))
        except self._failures as error:
            raise LinkError(f"{self.port}: {why(error)}") from None

    def close(self) -> None:
        """Close the line."""
        self._serial.close()


class Link:
    """Requests and their replies.

    `timeout` in s, above 0, else ValueError. `attempts`: how often a request that does no harm
    twice is sent. `sequence`: number of the last request. `strays`: frames that were no answer to
    it, broken ones and echoes too.
    """

    def __init__(
        self,
        stream: Stream,
        timeout: float = 1.0,
        attempts: int = 3,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 0.0 < timeout < math.inf:
            raise ValueError(f"timeout: got {timeout}; it has to be above 0 s, and finite")
        self._stream, self._timeout, self._attempts, self._clock = stream, timeout, attempts, clock
        self._splitter = Splitter()
        self.sequence = 0
        self.strays = 0

    def request(self, kind: Type, payload: bytes = b"", *, once: bool = False) -> bytes:
        """Send a request and return its reply's payload (docs/protocol.md).

        `once`: a step that was acted upon must not be taken twice. LinkError without a reply,
        RefusedError by the board, ProtocolError above MAX_PAYLOAD bytes.
        """
        resynchronised = False
        attempt = 0
        while True:
            attempt += 1
            try:
                reply = self._attempt(kind, payload)
            except RefusedError as refused:
                # After a restart of either side the board says where it stands: go on from there.
                if refused.outcome is not Outcome.STALE or resynchronised:
                    raise
                self.sequence, resynchronised = refused.last_sequence, True
                continue
            if reply is not None:
                return reply
            if once or attempt == self._attempts:
                times = "once" if attempt == 1 else f"{attempt} times"
                raise LinkError(f"no reply to {kind.name}, sent {times}")

    def _attempt(self, kind: Type, payload: bytes) -> bytes | None:
        self.sequence = p.next_sequence(self.sequence)
        self._stream.write(Frame(kind, self.sequence, payload).wire())
        until = self._clock() + self._timeout
        answer: Frame | None = None
        while answer is None and self._clock() < until:
            for stuffed in self._splitter.feed(self._stream.read()):
                _, frame = p.judge(stuffed)
                if answer is None and frame is not None and self._answers(frame, kind):
                    answer = frame
                else:
                    self.strays += 1
        if answer is None:
            return None
        if answer.kind == Type.REFUSED | p.REPLY:
            last = int.from_bytes(answer.payload[2:], "little")
            raise RefusedError(kind, Outcome(answer.payload[0]), last)
        return answer.payload

    def _answers(self, frame: Frame, kind: Type) -> bool:
        """Whether a frame is the reply to the request under way, or says that it is refused."""
        if frame.sequence != self.sequence:
            return False
        expected = {kind | p.REPLY: p.REPLY_SIZE[kind], Type.REFUSED | p.REPLY: 6}
        return expected.get(frame.kind) == len(frame.payload)
