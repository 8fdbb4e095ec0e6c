"""A board behind a link: identity, registers, counters, steps."""

from __future__ import annotations

import struct

from directmpc.host import protocol as p
from directmpc.host.link import Link, LinkError
from directmpc.host.protocol import Controller, Decision, Identity, Outcome, Type
from directmpc.host.registers import RegisterValues, packed, registers_of

_RESPONSES = {
    2: "there is no such register, or not for that access, or it is locked now (docs/registers.md)",
    3: "beyond the registers",
}


#: Registers that a board without the option takes and ignores, and the capability they need.
_NEEDED = {
    "parameters.two_switchings": "second_level",
    "parameters.compensate": "second_level",
    "parameters.deadlock_rule": "weighted_deadlock",
    "parameters.method_mpfc": "flux_control",
}


class RegisterError(RuntimeError):
    """A register cannot be read or written."""


class Board:
    """A board that has identified itself.

    Parameters
    ----------
    link : Link
        How it is reached.

    Raises
    ------
    LinkError
        If no board answers, or one with another version of the protocol.
    """

    def __init__(self, link: Link) -> None:
        self.link = link
        self.identity = Identity.unpack(link.request(Type.IDENTIFY))
        if self.identity.version != p.VERSION:
            raise LinkError(
                f"the board speaks version {self.identity.version} of the protocol, this program "
                f"version {p.VERSION}"
            )
        link.sequence = self.identity.last_sequence
        self._map = registers_of(self.controller)

    @property
    def controller(self) -> str:
        """As drive files write it.

        Returns
        -------
        str
            "mpdcc" or "mptc".
        """
        return self.identity.controller.name.lower()

    def read_word(self, address: int) -> int:
        """A register's word.

        Parameters
        ----------
        address : int
            Byte address, a multiple of 4.

        Returns
        -------
        int
            32 bits, unsigned.

        Raises
        ------
        LinkError
            If the board does not answer.
        RegisterError
            If there is no such register to read.
        """
        _, response, word = struct.unpack(
            "<HBI", self.link.request(Type.READ, struct.pack("<H", address))
        )
        if response:
            raise RegisterError(f"read of 0x{address:03X}: {_RESPONSES.get(response, response)}")
        return int(word)

    def write_word(self, address: int, word: int) -> None:
        """Write a register's word.

        Parameters
        ----------
        address : int
            Byte address, a multiple of 4.
        word : int
            32 bits, unsigned.

        Raises
        ------
        LinkError
            If the board does not answer.
        RegisterError
            If it is no word of 32 bits (nothing is sent then), or there is no such register to
            write.
        """
        if not 0 <= word < 1 << 32:
            raise RegisterError(f"write to 0x{address:03X}: {word} is not a word of 32 bits")
        _, response = struct.unpack(
            "<HB", self.link.request(Type.WRITE, struct.pack("<HI", address, word))
        )
        if response:
            raise RegisterError(f"write to 0x{address:03X}: {_RESPONSES.get(response, response)}")

    def read(self, name: str) -> dict[str, int]:
        """Fields of a register, signed where they are.

        Parameters
        ----------
        name : str
            Name of a register as in docs/registers.md.

        Returns
        -------
        dict of str to int
            Field to value, in the format that docs/registers.md gives.

        Raises
        ------
        KeyError
            If there is no such register.
        RegisterError
            If it cannot be read.
        """
        address, fields = self._map[name]
        word = self.read_word(address)
        found = {}
        for field, (low, width, signed) in fields.items():
            value = word >> low & (1 << width) - 1
            found[field] = value - (1 << width) if signed and value >> (width - 1) else value
        return found

    def write(self, name: str, **values: int) -> None:
        """Write fields of a register; those not given are written as 0.

        Parameters
        ----------
        name : str
            Name of a register as in docs/registers.md.
        **values : int
            Field to value, signed where the field is.

        Raises
        ------
        KeyError
            If there is no such register or field.
        RegisterError
            If a value does not fit its field; nothing is sent then.
        """
        address, fields = self._map[name]
        try:
            word = packed(name, fields, values)
        except ValueError as error:
            raise RegisterError(str(error)) from None
        self.write_word(address, word)

    def load(self, found: RegisterValues) -> int:
        """Write a drive's registers and commit them.

        Parameters
        ----------
        found : RegisterValues
            Of ``registers.values``.

        Returns
        -------
        int
            How many were written, the commit included.

        Raises
        ------
        LinkError
            If the drive is for the other controller.
        RegisterError
            If it asks for what was not built into this board, or a value does not fit its register;
            nothing is written then.
        """
        if found.controller != self.controller:
            raise LinkError(
                f"the drive file is for {found.controller}, the board has {self.controller}"
            )
        built = self.read("system.capabilities")
        for name, capability in _NEEDED.items():
            if found.words.get(name) and not built[capability]:
                raise RegisterError(
                    f"the drive sets {name}, which this board ignores: its capabilities lack "
                    f"{capability}"
                )
        try:
            writes = found.writes()
        except ValueError as error:
            raise RegisterError(str(error)) from None
        for _, address, word in writes:
            self.write_word(address, word)
        return len(writes)

    def differing(self, found: RegisterValues) -> list[str]:
        """Names of a drive's registers that read back another word than they should have.

        Parameters
        ----------
        found : RegisterValues
            What was loaded.

        Returns
        -------
        list of str
            In address order; empty where all is as it should be.

        Raises
        ------
        RegisterError
            If a register cannot be read.
        ValueError
            If a value does not fit its register.
        """
        # the commit, the last write, reads as nothing
        return [
            name for name, address, word in found.writes()[:-1] if self.read_word(address) != word
        ]

    def step(self, words: list[int], position: int) -> Decision:
        """Measurements in, decision out.

        Parameters
        ----------
        words : list of int
            The core's measurement ports, in port order, in LSB of their formats.
        position : int
            MPDCC: s(k-1), packed; MPTC: u.

        Returns
        -------
        Decision
            With the clocks that it took.

        Raises
        ------
        LinkError
            If no reply comes; a step is sent once.
        RefusedError
            If the board refuses it.
        """
        payload = p.step_payload(words, position)
        return Decision.unpack(self.link.request(Type.STEP, payload, once=True))

    def counters(self) -> dict[Outcome, int]:
        """Frames by outcome since the board's reset, of this link.

        Returns
        -------
        dict of Outcome to int
            0 to 2**32 - 1.

        Raises
        ------
        LinkError
            If the board does not answer.
        """
        counts: list[int] = []
        for first in range(0, p.OUTCOME_COUNT, p.COUNTERS_PER_REPLY):
            reply = self.link.request(Type.COUNTERS, bytes([first]))
            counts += struct.unpack(f"<{p.COUNTERS_PER_REPLY}I", reply)
        return {outcome: counts[outcome] for outcome in Outcome}

    def is_mpdcc(self) -> bool:
        """Which controller was built.

        Returns
        -------
        bool
            True for MPDCC, false for MPTC.
        """
        return self.identity.controller is Controller.MPDCC
