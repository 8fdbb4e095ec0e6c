"""A board behind SPI: a stream of bytes made of transactions (docs/protocol.md, SPI).

A request goes out in one transaction, whole: the board rejects one that is cut off. Its reply is
fetched with zeros in further ones, as long as the reply of such a request and a little longer. A
reply that a transaction cuts off comes again, whole, in the next one; its part is dropped here.

Two ways to a board:

* `Device`: an SPI controller of Linux, such as ``/dev/spidev0.0``, by the package spidev;
* `VirtualDevice`: a virtual board that was started with ``--spi``. Its pseudo-terminal carries
  transactions: `MARK`, two bytes of length, the lower first, and as many bytes; as many come back.
  The board skips what does not begin with the mark.
"""

from __future__ import annotations

import os
import select
import time
from typing import Protocol

from directmpc.host import protocol as p
from directmpc.host.link import LinkError, check_rate, line_failures, why

RATE = 10_000_000
"""SCK by default, Hz: a board with a core of 25 MHz takes three times as much."""

LEAD = 16
"""Bytes of a transaction that fetches a reply, before it has to begin."""

MARK = b"SPI"
"""Begin of a transaction on a virtual board's port."""

PATIENCE = 9.0
"""Seconds within which a virtual board has to answer a transaction."""


class Transactions(Protocol):
    """Something that does an SPI transaction: mode 0, most significant bit first."""

    def transfer(self, data: bytes, /) -> bytes:
        """Do one, with chip select low for all of it; as many bytes come back."""

    def close(self) -> None:
        """Give it back."""


class SpiStream:
    """A stream as `directmpc.host.link.Link` needs it."""

    def __init__(self, device: Transactions) -> None:
        self._device = device
        self._there = b""
        self._expected = p.MAX_PAYLOAD

    def write(self, data: bytes, /) -> object:
        """Send all bytes in one transaction; LinkError if it fails."""
        for stuffed in p.Splitter().feed(data):
            _, frame = p.judge(stuffed)
            if frame is not None:
                self._expected = p.REPLY_SIZE.get(frame.kind, p.MAX_PAYLOAD)
        self._there += self._whole(data)
        return len(data)

    def read(self) -> bytes:
        """What has come; does a transaction of zeros if nothing has. LinkError if it fails.

        Whole frames and zeros between them; empty where nothing has come.
        """
        # stuffing adds a byte, and a delimiter stands on either side
        size = self._expected + p.OVERHEAD + 3
        found = self._there or self._whole(bytes(LEAD + size))
        self._there = b""
        return found

    def _whole(self, data: bytes) -> bytes:
        """What a transaction brings, without a frame that it cuts off; empty if that is none."""
        came = self._device.transfer(data)
        whole = came[: came.rfind(0) + 1]
        return whole if any(whole) else b""

    def close(self) -> None:
        """Close the device."""
        self._device.close()


class Device:
    """An SPI controller of Linux, such as ``/dev/spidev0.0``, SCK in Hz.

    LinkError if it cannot be opened, the rate is none, or spidev is not installed.
    """

    def __init__(self, path: str, rate: int = RATE) -> None:
        try:
            import spidev  # an optional requirement of the package
        except ImportError:
            raise LinkError("spidev is not installed; pip install spidev does it") from None
        check_rate(path, rate)
        self.path = path
        self._device = spidev.SpiDev()
        try:
            self._device.open_path(path)
            self._device.mode = 0
            self._device.max_speed_hz = rate
        except (*line_failures(), TypeError) as error:
            self._device.close()
            raise LinkError(f"{path}: cannot be opened: {why(error)}") from None

    def transfer(self, data: bytes, /) -> bytes:
        """Do a transaction; as many bytes come back. LinkError if the controller fails."""
        try:
            return bytes(self._device.xfer2(list(data)))
        except line_failures() as error:
            raise LinkError(f"{self.path}: {why(error)}") from None

    def close(self) -> None:
        """Give the controller back."""
        self._device.close()


class VirtualDevice:
    """The SPI pins of a virtual board; LinkError if another program uses them."""

    def __init__(self, path: str) -> None:
        self.path = path
        try:  # here, not above: the other ways to a board need no pseudo-terminal
            import fcntl
            import termios
            import tty
        except ImportError:
            raise LinkError(
                f"{path}: cannot be opened: SPI needs Linux; other systems have a board's UART"
            ) from None
        try:
            self._line = os.open(path, os.O_RDWR | os.O_NOCTTY)
        except line_failures() as error:
            raise LinkError(f"{path}: cannot be opened: {why(error)}") from None
        try:
            fcntl.flock(self._line, fcntl.LOCK_EX | fcntl.LOCK_NB)
            tty.setraw(self._line)
            termios.tcflush(self._line, termios.TCIFLUSH)
        except line_failures() as error:
            os.close(self._line)
            raise LinkError(f"{path}: cannot be opened: {why(error)}") from None

    def transfer(self, data: bytes, /) -> bytes:
        """Do a transaction; as many bytes come back. LinkError if the board does not answer."""
        try:
            os.write(self._line, MARK + len(data).to_bytes(2, "little") + data)
            came = b""
            until = time.monotonic() + PATIENCE
            while len(came) < len(data):
                left = until - time.monotonic()
                if left <= 0 or not select.select([self._line], [], [], left)[0]:
                    raise LinkError(
                        f"{self.path}: no answer; was the virtual board started with --spi?"
                    )
                came += os.read(self._line, len(data) - len(came))
        except line_failures() as error:
            raise LinkError(f"{self.path}: {why(error)}") from None
        return came

    def close(self) -> None:
        """Close the line."""
        os.close(self._line)


def opened(path: str, rate: int = RATE) -> SpiStream:
    """The stream of a board behind SPI, SCK in Hz; a virtual board has its own rate.

    `path` is ``/dev/spidev...`` or the port of a virtual board. LinkError if it cannot be opened.
    """
    if path.startswith("/dev/spidev"):
        return SpiStream(Device(path, rate))
    return SpiStream(VirtualDevice(path))
