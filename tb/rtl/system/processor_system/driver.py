"""The C driver of ``examples/processor`` as a library that Python calls, on any bus."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

OK, BUS, UNKNOWN, OTHER_MAP, RANGE, TIMEOUT, BUSY, TRIPPED, NOT_FINITE = range(9)

_WRITE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32)
_READ = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_uint32, ctypes.POINTER(ctypes.c_uint32)
)
_POSITIONS = ("s_a", "s_b", "s_c", "held", "deadlock", "saturated", "exhausted", "length")


class BusCalls(ctypes.Structure):
    """``directmpc_bus``."""

    _fields_ = (("write", _WRITE), ("read", _READ), ("context", ctypes.c_void_p))


class Decision(ctypes.Structure):
    """``directmpc_decision``."""

    _fields_ = (*((name, ctypes.c_uint8) for name in _POSITIONS), ("cycles", ctypes.c_uint16))


class State(ctypes.Structure):
    """``drive_state``."""

    _fields_ = (
        ("current", ctypes.c_double * 2),
        ("reference", ctypes.c_double * 2),
        ("v_n", ctypes.c_double),
        ("v_ph", ctypes.c_double * 3),
        ("v_dc", ctypes.c_double),
        ("omega_s", ctypes.c_double),
        ("omega_r", ctypes.c_double),
    )


class Measurement(ctypes.Structure):
    """``directmpc_measurement``."""

    _fields_ = tuple(
        (name, ctypes.c_int32)
        for name in (
            "is_alpha", "is_beta", "psir_alpha", "psir_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c",
            "v_dc", "iref_alpha", "iref_beta", "omega_s", "omega_r",
        )
    )  # fmt: skip


class Write(ctypes.Structure):
    """``directmpc_write``."""

    _fields_ = (("address", ctypes.c_uint16), ("word", ctypes.c_uint32))


class System(ctypes.Structure):
    """``directmpc``."""

    _fields_ = (("bus", BusCalls), ("control", ctypes.c_uint32), ("deciding", ctypes.c_uint32))


class Driver:
    """The library, and a bus that Python answers for it.

    ``write(address, word)`` and ``read(address)`` raise ``OSError`` where the bus refuses.
    """

    def __init__(
        self, library: Path, write: Callable[[int, int], None], read: Callable[[int], int]
    ) -> None:
        self.library = ctypes.CDLL(str(library))
        self.library.drive_begin.argtypes = (BusCalls,)
        self.library.directmpc_open.argtypes = (ctypes.POINTER(System), BusCalls, ctypes.c_int)
        self.state = State.in_dll(self.library, "rig_state")
        self.decision = Decision.in_dll(self.library, "rig_decision")
        self.decisions = ctypes.c_int.in_dll(self.library, "rig_decisions")

        def on_write(_: object, address: int, word: int) -> int:
            try:
                write(address, word)
            except OSError:
                return 1
            return 0

        def on_read(_: object, address: int, word: ctypes._Pointer) -> int:
            try:
                word[0] = read(address)
            except OSError:
                return 1
            return 0

        self.bus = BusCalls(_WRITE(on_write), _READ(on_read), None)

    def __getattr__(self, name: str) -> Callable[..., int]:
        function = getattr(self.library, name)

        def called(*given: object) -> int:
            return int(function(*given))

        return called
