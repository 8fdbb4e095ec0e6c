"""What a file of recorded signals (FST) says of itself, read without GTKWave's library."""

from __future__ import annotations

import gzip
import struct
from dataclasses import dataclass
from pathlib import Path

_HEADER, _WHOLE = 0, 254  # kinds of blocks
_GZIP, _LZ4, _LZ4_TWICE = 4, 6, 7  # kinds of blocks that hold the hierarchy
# entries of the hierarchy; smaller ones are signals
_ATTRIBUTE, _END_OF_ATTRIBUTE, _SCOPE, _END_OF_SCOPE = 252, 253, 254, 255


@dataclass(frozen=True)
class Recorded:
    """Signals of a recording."""

    seconds: float  #: Simulated time at its end.
    signals: dict[str, int]  #: Name with the instances around it -> bits.


def read(path: Path) -> Recorded:
    """Names of the signals and the time that was recorded, of a file that GHDL has written."""
    data = path.read_bytes()
    found = _blocks(data)
    if _WHOLE in found:
        found = _blocks(gzip.decompress(found[_WHOLE][8:]))
    header = found[_HEADER]
    (end,) = struct.unpack_from(">Q", header, 8)
    (exponent,) = struct.unpack_from("b", header, 64)
    kind = next(kind for kind in (_GZIP, _LZ4, _LZ4_TWICE) if kind in found)
    (size,) = struct.unpack_from(">Q", found[kind])
    packed = found[kind][8:]
    if kind == _GZIP:
        hierarchy = gzip.decompress(packed)
    elif kind == _LZ4:
        hierarchy = _unpacked(packed)
    else:
        hierarchy = _unpacked(_unpacked(packed[8:]))
    assert len(hierarchy) == size
    return Recorded(end * 10.0**exponent, _names(hierarchy))


def _blocks(data: bytes) -> dict[int, bytes]:
    """Last block of each kind; a block's length counts the eight bytes that hold it."""
    found, at = {}, 0
    while at < len(data):
        (length,) = struct.unpack_from(">Q", data, at + 1)
        found[data[at]] = data[at + 9 : at + 1 + length]
        at += 1 + length
    return found


def _unpacked(data: bytes) -> bytes:
    """One block of LZ4."""
    out, at = bytearray(), 0

    def more(count: int) -> int:
        nonlocal at
        while count >= 15:
            count += data[at]
            at += 1
            if data[at - 1] != 255:
                break
        return count

    while at < len(data):
        token = data[at]
        at += 1
        literals = more(token >> 4)
        out += data[at : at + literals]
        at += literals
        if at == len(data):
            break
        offset = data[at] | data[at + 1] << 8
        at += 2
        for _ in range(more(token & 15) + 4):
            out.append(out[-offset])
    return bytes(out)


def _names(hierarchy: bytes) -> dict[str, int]:
    """Signals by full name; scopes without a name are not part of it."""
    signals: dict[str, int] = {}
    scopes: list[str] = []
    at = 0

    def text() -> str:
        nonlocal at
        end = hierarchy.index(0, at)
        found = hierarchy[at:end].decode()
        at = end + 1
        return found

    def number() -> int:
        nonlocal at
        found = shift = 0
        while True:
            byte = hierarchy[at]
            at += 1
            found |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return found

    while at < len(hierarchy):
        entry = hierarchy[at]
        at += 1
        if entry == _SCOPE:
            at += 1
            scopes.append(text())
            text()
        elif entry == _END_OF_SCOPE:
            scopes.pop()
        elif entry == _ATTRIBUTE:
            at += 2
            text()
            number()
        elif entry != _END_OF_ATTRIBUTE:
            at += 1
            name = text()
            signals[".".join([*filter(None, scopes), name])] = number()
            number()
    return signals
