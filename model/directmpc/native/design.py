"""One instance of a design: ports by name, decisions, registers, its state."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping

import numpy as np

from directmpc.native.library import NativeError, Port, load

#: Clocks within which every decision ends; the longest takes 4,300.
LIMIT = 20_000


class Design:
    """An instance of a design, after its reset.

    Parameters
    ----------
    name : str
        Of the design, such as "mpdcc_core".

    Attributes
    ----------
    ports : dict of Port
        By name; all but the clock.

    Raises
    ------
    NativeError
        If the library cannot be built or loaded.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._library = load(name)
        lines = [line.split() for line in self._library.directmpc_ports().decode().splitlines()]
        self.ports = {n: Port(n, int(width), way == "in") for way, n, width in lines}
        self._number = {n: k for k, n in enumerate(self.ports)}
        self._inputs = [n for n, port in self.ports.items() if port.is_input]
        self._outputs = [n for n, port in self.ports.items() if not port.is_input]
        self._place = {n: k for k, n in enumerate(self._inputs)}
        self._given = np.zeros(len(self._inputs), np.uint32)
        self._answer = np.zeros(len(self._outputs), np.uint32)
        self._pointers = self._given.ctypes.data, self._answer.ctypes.data
        self._handle = self._library.directmpc_create()
        if not self._handle:
            raise NativeError(f"{name}: no memory for an instance")

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.directmpc_destroy(self._handle)
            self._handle = None

    def reset(self) -> None:
        """Reset the instance; its inputs stay as they are."""
        self._library.directmpc_reset(self._handle)

    def give(self, values: Mapping[str, int]) -> None:
        """Values of inputs for the decisions to come.

        Parameters
        ----------
        values : mapping of str to int
            Name of an input -> word, signed or unsigned; what is not given stays.

        Raises
        ------
        KeyError
            If there is no such input.
        """
        for name, value in values.items():
            self._given[self._place[name]] = int(value) & 0xFFFF_FFFF

    def decide(self, limit: int = LIMIT) -> tuple[dict[str, int], int]:
        """Let the design decide on the inputs that `give` was given.

        Parameters
        ----------
        limit : int
            Clocks within which it has to answer.

        Returns
        -------
        outputs : dict of str to int
            Every output in the clock of valid, unsigned.
        cycles : int
            Clocks from start to valid.

        Raises
        ------
        NativeError
            If there is no answer within `limit` clocks.
        """
        cycles = self._library.directmpc_decide(self._handle, *self._pointers, limit)
        if not cycles:
            raise NativeError(f"{self.name}: no decision within {limit} clocks")
        return dict(zip(self._outputs, self._answer.tolist(), strict=True)), cycles

    def put(self, name: str, value: int) -> None:
        """Give an input its value from now on.

        Parameters
        ----------
        name : str
            Of the input.
        value : int
            Its word, signed or unsigned.
        """
        self._library.directmpc_put(self._handle, self._number[name], value & 0xFFFF_FFFF)

    def get(self, name: str) -> int:
        """A port's value.

        Parameters
        ----------
        name : str
            Of the port.

        Returns
        -------
        int
            Unsigned.
        """
        return self._library.directmpc_get(self._handle, self._number[name])

    def clocks(self, count: int) -> None:
        """Let clocks pass.

        Parameters
        ----------
        count : int
            How many.
        """
        self._library.directmpc_clocks(self._handle, count)

    def until(self, name: str, count: int) -> int:
        """Let clocks pass until a port has another value.

        Parameters
        ----------
        name : str
            Of the port.
        count : int
            Clocks at most.

        Returns
        -------
        int
            Clocks that have passed.
        """
        return self._library.directmpc_until(self._handle, self._number[name], count)

    @property
    def skipped(self) -> int:
        """Clock edges that were not computed, since nothing but counts could change.

        Returns
        -------
        int
            At most `edges`.
        """
        return self._library.directmpc_skipped(self._handle)

    @property
    def edges(self) -> int:
        """Clock edges since the instance was made.

        Returns
        -------
        int
            From 0 on.
        """
        return self._library.directmpc_edges(self._handle)

    def write(self, address: int, word: int) -> bool:
        """Write a register.

        Parameters
        ----------
        address, word : int
            Byte address, 32 bits.

        Returns
        -------
        bool
            Whether the answer was OKAY; SLVERR is False.

        Raises
        ------
        NativeError
            If the design has no registers, or there is no answer.
        """
        return self._answered(self._library.directmpc_write(self._handle, address, word))

    def read(self, address: int) -> int:
        """Read a register.

        Parameters
        ----------
        address : int
            Byte address.

        Returns
        -------
        int
            32 bits, unsigned.

        Raises
        ------
        NativeError
            If the design has no registers or not this one, or there is no answer.
        """
        word = ctypes.c_uint32()
        answer = self._library.directmpc_read(self._handle, address, ctypes.byref(word))
        if not self._answered(answer):
            raise NativeError(f"{self.name}: there is no register at 0x{address:03X}")
        return word.value

    def transfer(self, data: bytes) -> bytes:
        """One SPI transaction with a board, a clock a bit.

        Parameters
        ----------
        data : bytes
            To the board.

        Returns
        -------
        bytes
            What came back, as many.

        Raises
        ------
        NativeError
            If the design has no SPI.
        """
        back = ctypes.create_string_buffer(len(data))
        if self._library.directmpc_transfer(self._handle, data, back, len(data)):
            raise NativeError(f"{self.name}: there are no pins of SPI")
        return back.raw

    def _answered(self, answer: int) -> bool:
        if answer < 0:
            raise NativeError(f"{self.name}: no answer on the register bus")
        return answer == 0

    def save(self) -> bytes:
        """The whole state, for `restore` of an instance of the same library.

        Returns
        -------
        bytes
            A few ten thousand.
        """
        size = self._library.directmpc_state_size(self._handle)
        buffer = ctypes.create_string_buffer(size)
        self._library.directmpc_save(self._handle, buffer)
        return buffer.raw

    def restore(self, state: bytes) -> None:
        """Take up a state that `save` gave.

        Parameters
        ----------
        state : bytes
            As of `save`.

        Raises
        ------
        NativeError
            If the bytes are no state of this design.
        """
        if self._library.directmpc_restore(self._handle, state, len(state)):
            raise NativeError(f"{self.name}: these bytes are no state of this design")
